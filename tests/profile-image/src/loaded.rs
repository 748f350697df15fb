//! What the simulator puts into memory before it runs an image, so that one image plays any clip.
//!
//! The simulator finds each of these statics by its name in the ELF file. The compiler must not know their values: they
//! are read through [`black_box`].

use core::hint::black_box;
use core::slice;
use core::sync::atomic::{AtomicUsize, Ordering};
use cortex_m_rt::heap_start;

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
pub struct Number(u32);

impl Number {
    /// None yet.
    pub const NONE: Self = Self(0);

    /// It.
    pub fn get(&'static self) -> u32 {
        black_box(self).0
    }

    /// It, as a number of elements.
    pub fn elements(&'static self) -> usize {
        self.get() as usize
    }
}

/// Bytes of RAM after the image's own that were lent. The simulator reads it, and adds them to the image's RAM.
#[unsafe(no_mangle)]
static LENT_BYTES: AtomicUsize = AtomicUsize::new(0);

/// Memory of so many elements, which all are `value`.
#[inline(always)]
pub fn lend<T: Clone>(len: usize, value: T) -> &'static mut [T] {
    let ram = heap_start().cast::<u8>();
    let used = LENT_BYTES.load(Ordering::Relaxed);
    let used = used + ram.wrapping_add(used).align_offset(align_of::<T>());
    LENT_BYTES.store(used + len * size_of::<T>(), Ordering::Relaxed);
    let first = ram.wrapping_add(used).cast::<T>();
    // SAFETY: RAM from here on is not the image's, what was lent before ends here, and `first` is aligned. The stack is
    // megabytes away. Where the stack or the end of RAM is not, the simulator reports a fault.
    unsafe {
        for at in 0..len {
            first.add(at).write(value.clone());
        }
        slice::from_raw_parts_mut(first, len)
    }
}
