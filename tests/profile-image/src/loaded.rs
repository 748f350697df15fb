//! What the simulator puts into memory before it runs an image, so that one image plays any clip.
//!
//! The simulator finds each of these statics by its name in the ELF file. The compiler must not know their values: they
//! are read through [`black_box`].

use core::hint::black_box;
use core::slice;

/// A file in flash, after the image.
#[repr(C)]
pub struct File {
    address: usize,
    len: usize,
}

impl File {
    /// None yet.
    pub const NONE: Self = Self { address: 0, len: 0 };

    /// Its bytes.
    pub fn bytes(&'static self) -> &'static [u8] {
        let file = black_box(self);
        if file.len == 0 {
            return &[];
        }
        // SAFETY: the simulator has put so many bytes there, in flash that is not the image's, where nothing writes.
        unsafe { slice::from_raw_parts(file.address as *const u8, file.len) }
    }
}

/// A number in flash.
#[repr(transparent)]
pub struct Number(usize);

impl Number {
    /// None yet.
    pub const NONE: Self = Self(0);

    /// It.
    pub fn get(&'static self) -> usize {
        black_box(self).0
    }
}
