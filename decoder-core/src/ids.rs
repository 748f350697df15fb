//! Numbers, names and features of codecs and entropy stages, from their lists.

use crate::codec::list::for_each_codec;
use crate::entropy::list::for_each_stage;
use serde::{Deserialize, Serialize};

macro_rules! ids {
    ($(#[$about:meta])* $Id:ident { $($(#[$doc:meta])* $id:literal $Variant:ident($module:ident $(<$life:lifetime>)?) $name:literal [$($part:literal),*];)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u8)]
        pub enum $Id {
            $($(#[$doc])* $Variant = $id,)*
        }

        impl $Id {
            /// All, in the order of their numbers.
            pub const ALL: [Self; [$($id),*].len()] = [$(Self::$Variant),*];

            /// The one with this number in a header.
            pub const fn from_id(id: u8) -> Option<Self> {
                match id {
                    $($id => Some(Self::$Variant),)*
                    _ => None,
                }
            }

            /// Its number in a header.
            pub const fn id(self) -> u8 {
                self as u8
            }

            /// Its name, in lower case, which is also that of its feature in Cargo.toml.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$Variant => $name,)*
                }
            }

            /// Features of its parts, which may be left out alone.
            pub const fn parts(self) -> &'static [&'static str] {
                match self {
                    $(Self::$Variant => &[$($part),*],)*
                }
            }

            /// Whether it was linked.
            pub const fn is_linked(self) -> bool {
                match self {
                    $(Self::$Variant => cfg!(feature = $name),)*
                }
            }
        }
    };
}

macro_rules! codec_ids {
    (scalar { $($scalar:tt)* } other { $($other:tt)* }) => {
        ids! {
            /// A codec, as a header names it.
            CodecId { $($scalar)* $($other)* }
        }
    };
}

macro_rules! stage_ids {
    ($($stage:tt)*) => {
        ids! {
            /// An entropy stage, as a header names it.
            EntropyId { $($stage)* }
        }
    };
}

for_each_codec!(codec_ids);
for_each_stage!(stage_ids);

/// A feature of this crate: a part of the decoder of .mclip that may be left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Feature {
    /// A codec.
    Codec(CodecId),
    /// A part of a codec.
    Part {
        /// The codec.
        codec: CodecId,
        /// Which of [`CodecId::parts`].
        part: u8,
    },
    /// An entropy stage.
    Entropy(EntropyId),
}

impl Feature {
    /// Its name in Cargo.toml.
    pub fn name(self) -> &'static str {
        match self {
            Self::Codec(codec) => codec.name(),
            Self::Part { codec, part } => {
                codec.parts().get(usize::from(part)).copied().unwrap_or(codec.name())
            }
            Self::Entropy(stage) => stage.name(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::vec::Vec;

    #[test]
    fn numbers_and_names_are_one_to_one() {
        for (id, codec) in (0..).zip(CodecId::ALL) {
            assert_eq!((codec.id(), CodecId::from_id(id)), (id, Some(codec)));
        }
        for (id, stage) in (0..).zip(EntropyId::ALL) {
            assert_eq!((stage.id(), EntropyId::from_id(id)), (id, Some(stage)));
        }
        assert_eq!((CodecId::from_id(CodecId::ALL.len() as u8), EntropyId::from_id(99)), (None, None));
        let codecs = CodecId::ALL.into_iter();
        let names: Vec<&str> = codecs.flat_map(|codec| [&[codec.name()], codec.parts()].concat()).collect();
        let names = [names, EntropyId::ALL.map(EntropyId::name).to_vec()].concat();
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len(), "{names:?}");
    }

    #[test]
    fn features_have_their_names() {
        let adpcm = CodecId::Adpcm;
        assert_eq!(Feature::Codec(adpcm).name(), "adpcm");
        assert_eq!(Feature::Part { codec: adpcm, part: 1 }.name(), "adaptive-predictor");
        assert_eq!(Feature::Part { codec: adpcm, part: 9 }.name(), "adpcm");
        assert_eq!(Feature::Entropy(EntropyId::Huffman).name(), "huffman");
    }
}
