//! What an encoder of a codec is.

use crate::error::EncodeError;
use crate::quality::Quality;
use crate::task::Task;
use decoder_core::mclip::CodecId;
use decoder_core::quantise::MAX_BITS;
use std::fmt::Debug;

/// A codec's settings, which know how to encode with it: the mirror of its file in `decoder-core`.
///
/// Codecs that have a code a channel and frame implement [`ScalarEncode`](super::scalar::contract::ScalarEncode) besides, and
/// leave [`encode`](Self::encode) to [`scalar::encode`](super::scalar::encode::encode).
pub trait Encode: Debug + Sync {
    /// The codec in the list of codecs.
    fn id(&self) -> CodecId;

    /// Most bits of a code that may be asked for.
    fn most_bits(&self) -> u8 {
        MAX_BITS
    }

    /// Whether steps may be chosen freely. Otherwise the number of bits is what sets the quality.
    fn has_free_steps(&self) -> bool {
        true
    }

    /// Encodes a motion: a whole .mclip.
    ///
    /// # Errors
    /// [`EncodeError::NoFreeSteps`] where steps are asked for unless [`has_free_steps`](Self::has_free_steps), and
    /// [`EncodeError::Refused`] where a setting is outside what the format has.
    fn encode(&self, task: &Task<'_>, quality: Quality<'_>) -> Result<Vec<u8>, EncodeError>;

    /// What tells these settings from others of the codec, for a sentence: `second order`. May be empty.
    fn describe(&self) -> String {
        String::new()
    }

    /// The settings that a command line has.
    fn options(&self) -> &'static [CodecOption] {
        &[]
    }

    /// Changes the setting of an option of [`options`](Self::options).
    ///
    /// # Errors
    /// [`OptionError`] where it is no option of the codec, or cannot have this value.
    fn set(&mut self, option: &str, value: &str) -> Result<(), OptionError> {
        let _ = value;
        Err(OptionError::Unknown { codec: self.id().name(), option: option.to_owned() })
    }

    /// Says whether the options go together, once all are set.
    ///
    /// # Errors
    /// [`OptionError`] where they do not.
    fn check(&self) -> Result<(), OptionError> {
        Ok(())
    }

    /// Settings that each deserve a curve of rate against distortion, the standard ones among them, with a name for each
    /// that the codec's own name precedes.
    fn curves() -> Vec<(&'static str, Self)>
    where
        Self: Sized + Default,
    {
        vec![("", Self::default())]
    }

    /// Settings beside which a search within a limit of cycles should see these: those that take fewer cycles.
    fn cheaper(self) -> Vec<Self>
    where
        Self: Sized,
    {
        vec![self]
    }
}

/// A setting of a codec, as a command line has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodecOption {
    /// Its name, without dashes.
    pub name: &'static str,
    /// What its value is called.
    pub value_name: &'static str,
    /// The value that it has unless given.
    pub default: &'static str,
    /// What it is, in a sentence.
    pub help: &'static str,
    /// All values that there are, each with what it means; empty where there are too many.
    pub values: &'static [(&'static str, &'static str)],
}

/// Why an option cannot be set.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OptionError {
    /// The codec has no such option.
    #[error("codec {codec} has no --{option}")]
    Unknown {
        /// Name of the codec.
        codec: &'static str,
        /// What was to be set.
        option: String,
    },
    /// The option cannot have this value.
    #[error("--{option} is {found}, expected {expected}")]
    Value {
        /// Name of the option.
        option: &'static str,
        /// The value.
        found: String,
        /// What it may be.
        expected: String,
    },
}
