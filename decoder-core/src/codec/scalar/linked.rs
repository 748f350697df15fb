//! The scalar codecs that were linked, behind one type.

use super::byte_groups::GroupLoop;
use super::contract::ScalarCodec;
use super::loops::{Clock, Codes, Part};
use crate::channel::{Channel, Rules};
use crate::codec::contract::Codec;
use crate::codec::list::for_each_codec;
use crate::entropy::symbols::SymbolSource;
use crate::ids::CodecId;
use crate::memory::Needs;
use crate::quantise::adaptive::Adaptive;
use crate::quantise::quantiser::Step;
use crate::state::State;
use core::convert::Infallible;
use core::marker::PhantomData;
use fixed::types::I16F16;

macro_rules! linked_scalars {
    (
        scalar { $($(#[$doc:meta])* $id:literal $Variant:ident($module:ident $(<$life:lifetime>)?) $name:literal [$($part:literal),*];)* }
        other { $($other:tt)* }
    ) => {
        /// A scalar codec that was linked, with its parameters. A feature that is off takes its variant away.
        #[derive(Clone, Copy, Debug)]
        pub enum LinkedScalar<'a> {
            $(#[cfg(feature = $name)] $(#[$doc])* $Variant(crate::codec::$module::$Variant $(<$life>)?),)*
            /// Never there: for sets of features without any codec.
            #[doc(hidden)]
            Never(Infallible, PhantomData<&'a ()>),
        }

        impl LinkedScalar<'_> {
            /// Which codec it is.
            pub fn id(&self) -> CodecId {
                match self {
                    $(#[cfg(feature = $name)] Self::$Variant(_) => CodecId::$Variant,)*
                    Self::Never(never, _) => match *never {},
                }
            }
        }

        /// Calls a method of whichever codec it is.
        macro_rules! dispatch {
            ($self:ident, $codec:ident => $call:expr) => {
                match $self {
                    $(#[cfg(feature = $name)] LinkedScalar::$Variant($codec) => $call,)*
                    LinkedScalar::Never(never, _) => match *never {},
                }
            };
        }
    };
}

for_each_codec!(linked_scalars);

impl LinkedScalar<'_> {
    /// Writes the parameters: [`Codec::emit`].
    pub fn emit(&self, out: &mut impl Extend<u8>) {
        dispatch!(self, codec => codec.emit(out));
    }

    /// What the record of a channel may be: [`Codec::rules`].
    pub fn rules(&self) -> Rules {
        dispatch!(self, codec => codec.rules())
    }

    /// The memory that is needed: [`Codec::needs`].
    pub fn needs(&self, channels: usize) -> Needs {
        dispatch!(self, codec => codec.needs(channels))
    }

    pub(super) fn initial(&self, channel: &Channel<'_>) -> (Step, i32) {
        dispatch!(self, codec => codec.initial(channel))
    }

    pub(super) fn keeps_values(&self) -> bool {
        dispatch!(self, codec => codec.keeps_values())
    }

    pub(super) fn adaptive(&self) -> Option<Adaptive> {
        dispatch!(self, codec => codec.adaptive())
    }

    pub(super) fn group_loop(&self, states: &[State]) -> Option<GroupLoop> {
        dispatch!(self, codec => codec.group_loop(states))
    }

    pub(super) fn rows(&self) -> usize {
        dispatch!(self, codec => codec.rows())
    }

    #[inline(always)]
    pub(super) fn restart(&self, part: Part<'_>) {
        dispatch!(self, codec => codec.restart(part));
    }

    #[inline(always)]
    pub(super) fn advance<C: Codes>(&self, part: Part<'_>, codes: &mut C) {
        dispatch!(self, codec => codec.advance(part, codes));
    }

    #[inline(always)]
    pub(super) fn advance_symbols<S: SymbolSource>(
        &self,
        pose: &mut [I16F16],
        states: &mut [State],
        source: &mut S,
        codes: &[u8],
        position: usize,
    ) -> Option<usize> {
        dispatch!(self, codec => codec.advance_symbols(pose, states, source, codes, position))
    }

    #[inline(always)]
    pub(super) fn finish(&self, states: &mut [State], words: &[u32], halves: &[u16], clock: &Clock) {
        dispatch!(self, codec => codec.finish(states, words, halves, clock));
    }
}
