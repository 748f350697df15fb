//! One file a codec: its settings, and how they encode a motion. Each mirrors the file of the same name in `decoder-core`, and
//! the list of codecs there makes the modules, and the type that holds the settings of any codec.

pub mod encode;
pub mod scalar;

use decoder_core::mclip::CodecId;
use encode::Encode;

/// Takes the list of codecs apart: encoders do not care which of the codecs are scalar.
macro_rules! codecs {
    (scalar { $($scalar:tt)* } other { $($other:tt)* }) => {
        settings! { $($scalar)* $($other)* }
    };
}

macro_rules! settings {
    ($(
        #[doc = $about:literal]
        $id:literal $Codec:ident($module:ident $(<$life:lifetime>)?) $name:literal [$($part:literal),*];
    )*) => {
        $(
            #[doc = concat!($name, ":", $about)]
            pub mod $module;
        )*

        // An encoder decodes what it makes, so a codec that was forgotten in decoder-core's default features shows here.
        $(const _: () = assert!(
            CodecId::$Codec.is_linked(),
            concat!("put the feature ", $name, " of decoder-core into its `default`")
        );)*

        /// A codec with its settings.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum CodecSettings {
            $(
                #[doc = $about]
                $Codec($module::$Codec),
            )*
        }

        impl CodecSettings {
            /// The settings that a codec has unless others are asked for.
            pub fn new(codec: CodecId) -> Self {
                match codec {
                    $(CodecId::$Codec => Self::$Codec($module::$Codec::default()),)*
                }
            }

            /// Which codec it is.
            pub const fn id(&self) -> CodecId {
                match self {
                    $(Self::$Codec(_) => CodecId::$Codec,)*
                }
            }

            /// The encoder that these are the settings of.
            pub fn encoder(&self) -> &dyn Encode {
                match self {
                    $(Self::$Codec(settings) => settings,)*
                }
            }

            /// As [`encoder`](Self::encoder), to change it.
            pub fn encoder_mut(&mut self) -> &mut dyn Encode {
                match self {
                    $(Self::$Codec(settings) => settings,)*
                }
            }

            /// Settings of a codec that each deserve a curve, as [`Encode::curves`] has them.
            pub fn curves(codec: CodecId) -> Vec<(&'static str, Self)> {
                match codec {
                    $(CodecId::$Codec => {
                        let curves = $module::$Codec::curves().into_iter();
                        curves.map(|(name, settings)| (name, Self::$Codec(settings))).collect()
                    })*
                }
            }

            /// Settings that take fewer cycles, and these, as [`Encode::cheaper`] has them.
            pub fn cheaper(self) -> Vec<Self> {
                match self {
                    $(Self::$Codec(settings) => settings.cheaper().into_iter().map(Self::$Codec).collect(),)*
                }
            }
        }

        /// What a codec is, in some words, as the list of codecs has it.
        pub const fn about(codec: CodecId) -> &'static str {
            match codec {
                $(CodecId::$Codec => $about,)*
            }
        }

        $(impl From<$module::$Codec> for CodecSettings {
            fn from(settings: $module::$Codec) -> Self {
                Self::$Codec(settings)
            }
        })*
    };
}

decoder_core::for_each_codec!(codecs);
