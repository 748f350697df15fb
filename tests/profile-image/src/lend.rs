//! Memory for a decoder, as much as its clip needs.

use core::slice;
use cortex_m_rt::heap_start;
use decoder_core::I16F16;
use decoder_core::mclip::State;

/// What bytes of 0 are a value of.
///
/// # Safety
/// They are.
pub unsafe trait Zero {}

// SAFETY: an integer.
unsafe impl Zero for u16 {}
// SAFETY: an integer.
unsafe impl Zero for u32 {}
// SAFETY: an integer.
unsafe impl Zero for i32 {}
// SAFETY: an integer in a struct.
unsafe impl Zero for I16F16 {}
// SAFETY: a struct of integers alone.
unsafe impl Zero for State {}

/// RAM after the image's own. An image has one of these.
pub struct SpareRam {
    /// Bytes that were lent.
    used: usize,
}

impl SpareRam {
    /// Nothing is lent yet.
    pub const fn new() -> Self {
        Self { used: 0 }
    }

    /// Memory of so many elements, which all are 0.
    #[inline(always)]
    pub fn lend<T: Zero>(&mut self, len: usize) -> &'static mut [T] {
        let rest = heap_start().cast::<u8>().wrapping_add(self.used);
        let padding = rest.align_offset(align_of::<T>());
        self.used += padding + len * size_of::<T>();
        let first = rest.wrapping_add(padding).cast::<T>();
        // SAFETY: RAM from here on is not the image's, what was lent before ends here, `first` is aligned, and the
        // simulator's RAM begins as bytes of 0. The stack is megabytes away. Where the stack or the end of RAM is not,
        // the simulator reports a fault.
        unsafe { slice::from_raw_parts_mut(first, len) }
    }
}
