//! The entropy stages that were linked, behind one type.

use super::list::for_each_stage;
use super::stage::{FrameLoops, Stage};
use crate::error::Error;
use crate::ids::{EntropyId, Feature};
use core::convert::Infallible;
use core::marker::PhantomData;

macro_rules! linked_stages {
    ($($(#[$doc:meta])* $id:literal $Variant:ident($module:ident $(<$life:lifetime>)?) $name:literal [];)*) => {
        /// An entropy stage that was linked. A feature that is off takes its variant away.
        #[derive(Debug)]
        pub(crate) enum LinkedStage<'s> {
            $(#[cfg(feature = $name)] $(#[$doc])* $Variant(super::$module::$Variant $(<$life>)?),)*
            /// Never there: for sets of features without any stage.
            #[allow(dead_code)]
            Never(Infallible, PhantomData<&'s mut ()>),
        }

        impl<'s> LinkedStage<'s> {
            /// Checks the tables of a stage: [`Stage::check`].
            ///
            /// # Errors
            /// [`Error::NotLinked`] where the stage was left out.
            pub fn check(stage: EntropyId, tables: &[u8], at: usize) -> Result<u8, Error> {
                match stage {
                    $(#[cfg(feature = $name)] EntropyId::$Variant => <super::$module::$Variant $(<$life>)?>::check(tables, at),)*
                    $(#[cfg(not(feature = $name))] EntropyId::$Variant => not_linked(tables, at, stage),)*
                }
            }

            /// The memory that a stage needs: [`Stage::halves`]; none where it was left out.
            pub fn halves(stage: EntropyId, tables: &[u8]) -> usize {
                match stage {
                    $(#[cfg(feature = $name)] EntropyId::$Variant => <super::$module::$Variant $(<$life>)?>::halves(tables),)*
                    $(#[cfg(not(feature = $name))] EntropyId::$Variant => 0,)*
                }
            }

            /// Opens a stage: [`Stage::open`].
            ///
            /// # Errors
            /// [`Error::NotLinked`] where it was left out.
            pub fn open(
                stage: EntropyId,
                tables: &[u8],
                at: usize,
                halves: &'s mut [u16],
            ) -> Result<Self, Error> {
                match stage {
                    $(#[cfg(feature = $name)]
                    EntropyId::$Variant => <super::$module::$Variant $(<$life>)?>::open(tables, at, halves).map(Self::$Variant),)*
                    $(#[cfg(not(feature = $name))]
                    EntropyId::$Variant => not_linked(&*halves, (tables, at), stage),)*
                }
            }

            /// Whether codes are of fixed width: [`Stage::BYTE_GROUPS`].
            pub fn has_byte_groups(&self) -> bool {
                match self {
                    $(#[cfg(feature = $name)] Self::$Variant(_) => <super::$module::$Variant $(<$life>)?>::BYTE_GROUPS,)*
                    Self::Never(never, _) => match *never {},
                }
            }

            /// What is kept of a channel at first: [`Stage::context`].
            pub fn context(&self, group: u8, bits: u8) -> u8 {
                match self {
                    $(#[cfg(feature = $name)] Self::$Variant(stage) => stage.context(group, bits),)*
                    Self::Never(never, _) => match *never {},
                }
            }

            /// Begins anew at an entry point: [`Stage::restart`].
            #[inline(always)]
            pub fn restart<'c>(&mut self, contexts: impl Iterator<Item = &'c mut u8>) {
                match self {
                    $(#[cfg(feature = $name)] Self::$Variant(stage) => stage.restart(contexts),)*
                    Self::Never(never, _) => match *never {},
                }
            }

            /// The bit where codes begin: [`Stage::codes_from`].
            #[inline(always)]
            pub fn codes_from(&self, position: usize) -> usize {
                match self {
                    $(#[cfg(feature = $name)] Self::$Variant(stage) => stage.codes_from(position),)*
                    Self::Never(never, _) => match *never {},
                }
            }

            /// Runs the loops of a frame: [`Stage::feed`].
            #[inline(always)]
            pub fn feed<L: FrameLoops>(&mut self, loops: L) -> Option<usize> {
                match self {
                    $(#[cfg(feature = $name)] Self::$Variant(stage) => stage.feed(loops),)*
                    Self::Never(never, _) => match *never {},
                }
            }
        }
    };
}

for_each_stage!(linked_stages);

/// What a stage that was left out says, whatever it is given.
#[allow(dead_code, reason = "only where a feature is off")]
fn not_linked<A, B, T>(_: A, _: B, stage: EntropyId) -> Result<T, Error> {
    Err(Error::NotLinked { feature: Feature::Entropy(stage) })
}
