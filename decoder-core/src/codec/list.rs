//! The list of codecs. Modules, ids, names, features and dispatch come from it, here and in the crate `encoder`: a codec is a
//! line here and a file beside.

/// Hands the list to the macro `$then`. A row has the codec's documentation, its number in a header, its type and the
/// file beside that has it, its name, which is also that of its feature, and features of its own parts, which may be left out
/// alone.
///
/// A `scalar` codec has a code a channel and frame: it implements [`ScalarCodec`](crate::codec::scalar::ScalarCodec), and
/// [`ScalarDecoder`](crate::codec::scalar::ScalarDecoder) runs it with every entropy stage. Any `other` codec implements
/// [`CodecWithDecoder`](crate::codec::CodecWithDecoder).
#[macro_export]
macro_rules! for_each_codec {
    ($then:ident) => {
        $then! {
            scalar {
                /// Values in steps between two limits.
                0 Pcm(pcm) "pcm" [];
                /// Differences to a prediction, in mu-law steps.
                1 MuLaw(mulaw<'a>) "mulaw" [];
                /// Differences to a prediction, in steps.
                2 Dpcm(dpcm) "dpcm" [];
                /// The same with a quantiser, a predictor or both that adapt.
                3 Adpcm(adpcm) "adpcm" ["adaptive-step", "adaptive-predictor"];
                /// Differences from a look-up table.
                4 Qmd(qmd<'a>) "qmd" [];
            }
            other {}
        }
    };
}

pub(crate) use for_each_codec;
