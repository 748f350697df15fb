//! The codecs that were linked, behind one type; and their decoders.

use super::contract::{FrameDecoder, Shape};
use super::list::for_each_codec;
use super::scalar::decoder::{self, ScalarDecoder};
use super::scalar::linked::LinkedScalar;
use crate::I16F16;
use crate::channel::{Channel, Rules};
use crate::error::Error;
use crate::ids::{CodecId, Feature};
use crate::memory::{Memory, Needs};

macro_rules! linked_codecs {
    (
        scalar { $($(#[$doc:meta])* $id:literal $Variant:ident($module:ident $(<$life:lifetime>)?) $name:literal [$($part:literal),*];)* }
        other {
            $($(#[$other_doc:meta])* $other_id:literal $Other:ident($other:ident $(<$other_life:lifetime>)?) $other_name:literal [$($other_part:literal),*];)*
        }
    ) => {
        /// A codec that was linked, with its parameters. A feature that is off takes its variant away.
        #[derive(Clone, Copy, Debug)]
        pub enum LinkedCodec<'a> {
            /// One of those that have a code a channel and frame.
            Scalar(LinkedScalar<'a>),
            $(#[cfg(feature = $other_name)] $(#[$other_doc])* $Other(super::$other::$Other $(<$other_life>)?),)*
        }

        /// A decoder of a codec that was linked.
        #[derive(Debug)]
        pub enum RunningCodec<'a, 's> {
            /// That of all scalar codecs.
            Scalar(ScalarDecoder<'a, 's>),
            $(
                #[cfg(feature = $other_name)]
                $(#[$other_doc])*
                $Other(<super::$other::$Other $(<$other_life>)? as super::contract::CodecWithDecoder<'a>>::Decoder<'s>),
            )*
        }

        impl<'a> LinkedCodec<'a> {
            /// Reads a codec's parameters, which are in the structure at byte `at`:
            /// [`Codec::parse`](super::contract::Codec::parse).
            ///
            /// # Errors
            /// As that, and [`Error::NotLinked`] where the codec was left out.
            pub fn parse(id: CodecId, parameters: &'a [u8], at: usize) -> Result<Self, Error> {
                match id {
                    $(
                        #[cfg(feature = $name)]
                        CodecId::$Variant => <super::$module::$Variant $(<$life>)? as super::contract::Codec<'a>>::parse(parameters, at)
                            .map(|codec| Self::Scalar(LinkedScalar::$Variant(codec))),
                        #[cfg(not(feature = $name))]
                        CodecId::$Variant => not_linked(parameters, at, id),
                    )*
                    $(
                        #[cfg(feature = $other_name)]
                        CodecId::$Other => <super::$other::$Other $(<$other_life>)? as super::contract::Codec<'a>>::parse(parameters, at)
                            .map(Self::$Other),
                        #[cfg(not(feature = $other_name))]
                        CodecId::$Other => not_linked(parameters, at, id),
                    )*
                }
            }

            /// Which codec it is.
            pub fn id(&self) -> CodecId {
                match self {
                    Self::Scalar(codec) => codec.id(),
                    $(#[cfg(feature = $other_name)] Self::$Other(_) => CodecId::$Other,)*
                }
            }

            /// Writes the parameters: [`Codec::emit`](super::contract::Codec::emit).
            pub fn emit(&self, out: &mut impl Extend<u8>) {
                match self {
                    Self::Scalar(codec) => codec.emit(out),
                    $(#[cfg(feature = $other_name)] Self::$Other(codec) => codec.emit(out),)*
                }
            }

            /// What the record of a channel may be: [`Codec::rules`](super::contract::Codec::rules).
            pub fn rules(&self) -> Rules {
                match self {
                    Self::Scalar(codec) => codec.rules(),
                    $(#[cfg(feature = $other_name)] Self::$Other(codec) => codec.rules(),)*
                }
            }

            /// The memory that a decoder needs, that of the entropy stage included.
            pub fn needs(&self, shape: &Shape<'_>) -> Needs {
                match self {
                    Self::Scalar(codec) => decoder::needs(codec, shape),
                    $(#[cfg(feature = $other_name)] Self::$Other(codec) => codec.needs(shape.channels),)*
                }
            }

            /// Frames by which a pose lags behind its codes: [`Codec::delay`](super::contract::Codec::delay).
            pub fn delay(&self) -> u16 {
                match self {
                    Self::Scalar(_) => 0,
                    $(#[cfg(feature = $other_name)] Self::$Other(codec) => codec.delay(),)*
                }
            }

            /// A decoder before any entry point, for these channels, in memory of at least what is needed.
            ///
            /// # Errors
            /// [`Error::OutputTooSmall`], or [`Error::Encoding`] where the entropy stage's tables are none.
            pub fn open<'s>(
                &self,
                shape: Shape<'a>,
                channels: impl Iterator<Item = Channel<'a>>,
                memory: Memory<'s>,
            ) -> Result<RunningCodec<'a, 's>, Error> {
                match *self {
                    Self::Scalar(codec) => {
                        ScalarDecoder::open(codec, shape, channels, memory).map(RunningCodec::Scalar)
                    }
                    $(
                        #[cfg(feature = $other_name)]
                        Self::$Other(codec) => super::contract::CodecWithDecoder::open(codec, shape, channels, memory)
                            .map(RunningCodec::$Other),
                    )*
                }
            }
        }

        impl FrameDecoder for RunningCodec<'_, '_> {
            #[inline(always)]
            fn delay(&self) -> u16 {
                match self {
                    Self::Scalar(decoder) => decoder.delay(),
                    $(#[cfg(feature = $other_name)] Self::$Other(decoder) => decoder.delay(),)*
                }
            }

            #[inline(always)]
            fn begin(&mut self, codes: &[u8], entry: bool) -> Option<bool> {
                match self {
                    Self::Scalar(decoder) => decoder.begin(codes, entry),
                    $(#[cfg(feature = $other_name)] Self::$Other(decoder) => decoder.begin(codes, entry),)*
                }
            }

            #[inline(always)]
            fn next_frame(&mut self, codes: &[u8]) -> Option<()> {
                match self {
                    Self::Scalar(decoder) => decoder.next_frame(codes),
                    $(#[cfg(feature = $other_name)] Self::$Other(decoder) => decoder.next_frame(codes),)*
                }
            }

            #[inline(always)]
            fn drain(&mut self) {
                match self {
                    Self::Scalar(decoder) => decoder.drain(),
                    $(#[cfg(feature = $other_name)] Self::$Other(decoder) => decoder.drain(),)*
                }
            }

            #[inline(always)]
            fn used(&self) -> usize {
                match self {
                    Self::Scalar(decoder) => decoder.used(),
                    $(#[cfg(feature = $other_name)] Self::$Other(decoder) => decoder.used(),)*
                }
            }

            #[inline(always)]
            fn pose(&self) -> &[I16F16] {
                match self {
                    Self::Scalar(decoder) => decoder.pose(),
                    $(#[cfg(feature = $other_name)] Self::$Other(decoder) => decoder.pose(),)*
                }
            }
        }
    };
}

for_each_codec!(linked_codecs);

/// What a codec that was left out says, whatever it is given.
#[allow(dead_code, reason = "only where a feature is off")]
fn not_linked<A, B, T>(_: A, _: B, codec: CodecId) -> Result<T, Error> {
    Err(Error::NotLinked { feature: Feature::Codec(codec) })
}
