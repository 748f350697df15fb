//! What both images do: open the clip, hash frames.

use core::ffi::CStr;
use core::fmt;
use cortex_m_rt::{ExceptionFrame, exception};
use decoder_core::I16F16;
use semihosting::fs::File;
use semihosting::process;
use sha2::{Digest, Sha256};

/// Longest path.
const PATH: usize = 256;

/// The file that the only argument names.
pub fn open() -> File {
    let arguments = semihosting::experimental::env::args::<PATH>().expect("there are no arguments");
    let path = (&arguments).next().expect("there is no argument").expect("the path is not UTF-8");
    let mut terminated = [0; PATH];
    terminated[..path.len()].copy_from_slice(path.as_bytes());
    let path = CStr::from_bytes_until_nul(&terminated).expect("the path is too long");
    File::open(path).expect("the clip cannot be opened")
}

/// Frames on their way to a hash: raw words, little-endian, frame by frame.
pub struct Frames(Sha256);

impl Frames {
    /// No frames.
    pub fn new() -> Self {
        Self(Sha256::new())
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: &[I16F16]) {
        for value in frame {
            self.0.update(value.to_bits().to_le_bytes());
        }
    }

    /// The hash of all frames.
    pub fn finish(self) -> Hash {
        Hash(self.0.finalize().into())
    }
}

/// A SHA-256, displayed as hexadecimal digits.
#[derive(PartialEq, Eq)]
pub struct Hash([u8; 32]);

impl fmt::Display for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    semihosting::println!("hard fault at {:#010x}, called from {:#010x}", frame.pc(), frame.lr());
    process::exit(1)
}
