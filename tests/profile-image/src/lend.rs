//! Memory for a decoder, as much as its clip needs.

use core::slice;
use cortex_m_rt::heap_start;

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

    /// Memory of so many elements, which all are `value`.
    #[inline(always)]
    pub fn lend<T: Clone>(&mut self, len: usize, value: T) -> &'static mut [T] {
        let rest = heap_start().cast::<u8>().wrapping_add(self.used);
        let padding = rest.align_offset(align_of::<T>());
        self.used += padding + len * size_of::<T>();
        let first = rest.wrapping_add(padding).cast::<T>();
        // SAFETY: RAM from here on is not the image's, what was lent before ends here, and `first` is aligned. The stack
        // is megabytes away. Where the stack or the end of RAM is not, the simulator reports a fault.
        unsafe {
            for at in 0..len {
                first.add(at).write(value.clone());
            }
            slice::from_raw_parts_mut(first, len)
        }
    }
}
