//! Plays int16 frames that tamp's decompressor, C code, unpacks one at a time from one stream.
#![no_std]
#![no_main]

#[path = "../../../tests/profile-image/src/ends.rs"]
mod ends;
#[path = "../../../tests/profile-image/src/loaded.rs"]
mod loaded;
mod player;

use core::ptr;
use player::{FRAME, WINDOW_BITS};
use tamp_sys::{
    TampConf, TampDecompressor, tamp_decompressor_decompress_cb, tamp_decompressor_init,
    tamp_decompressor_read_header,
};

/// Bytes of the window.
const WINDOW_BYTES: usize = 1 << WINDOW_BITS;

/// What was unpacked last. Not in `Store`, which is moved: the decompressor keeps a pointer to it.
static mut WINDOW: [u8; WINDOW_BYTES] = [0; WINDOW_BYTES];

struct Store {
    rest: &'static [u8],
    frame: [u8; FRAME],
    decompressor: TampDecompressor,
}

impl Store {
    /// May be called once.
    fn new(bytes: &'static [u8]) -> Option<Self> {
        // SAFETY: plain C structures, for which zeros are values.
        let (mut decompressor, mut conf): (TampDecompressor, TampConf) = unsafe { core::mem::zeroed() };
        let mut consumed = 0;
        // SAFETY: all pointers are to memory of the lengths that are given; nothing else uses the window, and the header
        // is checked before it says how much of it.
        let result = unsafe {
            match tamp_decompressor_read_header(&mut conf, bytes.as_ptr(), bytes.len(), &mut consumed) {
                0 if conf.window() == WINDOW_BITS => {
                    tamp_decompressor_init(&mut decompressor, &conf, (&raw mut WINDOW).cast())
                }
                _ => return None,
            }
        };
        let rest = bytes.get(consumed..)?;
        (result == 0).then_some(Self { rest, frame: [0; FRAME], decompressor })
    }

    fn frame(&mut self) -> Option<&[u8]> {
        let (mut written, mut consumed) = (0, 0);
        // SAFETY: all pointers are to memory of the lengths that are given.
        let result = unsafe {
            tamp_decompressor_decompress_cb(
                &mut self.decompressor,
                self.frame.as_mut_ptr(),
                FRAME,
                &mut written,
                self.rest.as_ptr(),
                self.rest.len(),
                &mut consumed,
                None,
                ptr::null_mut(),
            )
        };
        // Above 0 are the ends of input and output.
        self.rest = self.rest.get(consumed..)?;
        (result >= 0 && written == FRAME).then_some(&self.frame)
    }
}
