//! One file a codec: its settings, and how they encode a motion.

pub mod adpcm;
pub mod dpcm;
pub mod encode;
pub mod mulaw;
pub mod pcm;
pub mod qmd;
pub mod scalar;

use decoder_core::mclip::CodecId;
use encode::Encode;

macro_rules! codecs {
    ($($Codec:ident($Settings:ty);)*) => {
        /// A codec with its settings.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum CodecSettings {
            $(
                #[doc = concat!("[`", stringify!($Codec), "`](", stringify!($Settings), ").")]
                $Codec($Settings),
            )*
        }

        impl CodecSettings {
            /// The settings that a codec has unless others are asked for.
            pub fn new(codec: CodecId) -> Self {
                match codec {
                    $(CodecId::$Codec => Self::$Codec(<$Settings>::default()),)*
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
                        let curves = <$Settings>::curves().into_iter();
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

        $(impl From<$Settings> for CodecSettings {
            fn from(settings: $Settings) -> Self {
                Self::$Codec(settings)
            }
        })*
    };
}

codecs! {
    Pcm(pcm::Pcm);
    MuLaw(mulaw::MuLaw);
    Dpcm(dpcm::Dpcm);
    Adpcm(adpcm::Adpcm);
    Qmd(qmd::Qmd);
}

impl CodecSettings {
    /// Which codec it is.
    pub fn id(&self) -> CodecId {
        self.encoder().id()
    }
}
