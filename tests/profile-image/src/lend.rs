//! Memory for a decoder, as much as its clip needs.

use core::slice;
use core::sync::atomic::{AtomicUsize, Ordering};
use cortex_m_rt::heap_start;

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
