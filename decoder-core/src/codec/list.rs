//! The list of codecs. Ids, names, features and dispatch come from it: a codec is a line here and a file beside.

/// Hands the list to the macro `$then`: number in a header, variant, type, name, which is also that of its feature, and
/// features of its own parts, which may be left out alone.
///
/// A `scalar` codec has a code a channel and frame: it implements [`ScalarCodec`](crate::codec::scalar::ScalarCodec), and
/// [`ScalarDecoder`](crate::codec::scalar::ScalarDecoder) runs it with every entropy stage. Any `other` codec implements
/// [`Codec`](crate::codec::Codec) with a decoder of its own.
macro_rules! for_each_codec {
    ($then:ident) => {
        $then! {
            scalar {
                /// Values in steps between two limits.
                0 Pcm(crate::codec::pcm::Pcm) "pcm" [];
                /// Differences to a prediction, in mu-law steps.
                1 MuLaw(crate::codec::mulaw::MuLawCodec<'a>) "mulaw" [];
                /// Differences to a prediction, in steps.
                2 Dpcm(crate::codec::dpcm::Dpcm) "dpcm" [];
                /// The same with a quantiser, a predictor or both that adapt.
                3 Adpcm(crate::codec::adpcm::Adpcm) "adpcm" ["adaptive-step", "adaptive-predictor"];
                /// Differences from a look-up table.
                4 Qmd(crate::codec::qmd::Qmd<'a>) "qmd" [];
            }
            other {}
        }
    };
}

pub(crate) use for_each_codec;
