//! Enums whose variants have fixed numbers in bytes that leave the program.

use core::fmt;

/// Declares an enum of fixed numbers: the order of its variants means nothing, and its bytes are a number each.
///
/// A number is never given to something else; a variant that goes away leaves a gap.
macro_rules! numbered {
    ($(#[$meta:meta])* pub enum $name:ident { $($(#[$about:meta])* $variant:ident = $number:literal,)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        #[serde(into = "u8", try_from = "u8")]
        #[repr(u8)]
        pub enum $name { $($(#[$about])* $variant = $number,)+ }

        impl $name {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)+];

            /// Its number in bytes.
            pub const fn number(self) -> u8 {
                self as u8
            }
        }

        impl From<$name> for u8 {
            fn from(value: $name) -> Self {
                value.number()
            }
        }

        impl TryFrom<u8> for $name {
            type Error = $crate::numbered::UnknownNumber;

            fn try_from(number: u8) -> Result<Self, Self::Error> {
                match number {
                    $($number => Ok(Self::$variant),)+
                    found => Err($crate::numbered::UnknownNumber { found }),
                }
            }
        }
    };
}

pub(crate) use numbered;

/// A number that nothing has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownNumber {
    /// The number.
    pub found: u8,
}

impl fmt::Display for UnknownNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the number {} has no meaning", self.found)
    }
}

impl core::error::Error for UnknownNumber {}
