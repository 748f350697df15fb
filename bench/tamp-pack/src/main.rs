//! Packs standard input to standard output with tamp, as one stream with tamp's own header.
//!
//! The argument is the number of bits of the window. This is no part of `bunraku`, because building tamp's crate takes
//! libclang, which most machines do not have.

use std::io::{self, Read, Write};
use std::process::ExitCode;
use tamp_sys::{
    TampCompressor, TampConf, tamp_compressor_compress_and_flush_cb, tamp_compressor_init, tamp_res,
};

/// Packs all of `bytes` with a window of 2 to the power of `bits` bytes.
fn pack(bytes: &[u8], bits: u16) -> Result<Vec<u8>, tamp_res> {
    // SAFETY: plain C structures, for which zeros are values.
    let (mut compressor, mut conf): (TampCompressor, TampConf) = unsafe { std::mem::zeroed() };
    conf.set_window(bits);
    conf.set_literal(8);
    let mut window = vec![0; 1 << bits];
    // 9 bits a byte that is not found before, the header, and what flushing takes.
    let mut packed = vec![0; bytes.len() / 8 * 9 + 64];
    let (mut written, mut consumed) = (0, 0);
    // SAFETY: all pointers are to memory of the lengths that are given, and `window` outlives the compressor.
    let result = unsafe {
        match tamp_compressor_init(&mut compressor, &conf, window.as_mut_ptr()) {
            0 => tamp_compressor_compress_and_flush_cb(
                &mut compressor,
                packed.as_mut_ptr(),
                packed.len(),
                &mut written,
                bytes.as_ptr(),
                bytes.len(),
                &mut consumed,
                false,
                None,
                std::ptr::null_mut(),
            ),
            error => error,
        }
    };
    if result != 0 || consumed != bytes.len() {
        return Err(result);
    }
    packed.truncate(written);
    Ok(packed)
}

fn main() -> ExitCode {
    let Some(bits) = std::env::args().nth(1).and_then(|bits| bits.parse().ok()) else {
        eprintln!("tamp-pack: expected the bits of the window, 8 to 15");
        return ExitCode::from(2);
    };
    let mut bytes = Vec::new();
    if let Err(error) = io::stdin().read_to_end(&mut bytes) {
        eprintln!("tamp-pack: cannot read: {error}");
        return ExitCode::FAILURE;
    }
    match pack(&bytes, bits) {
        Ok(packed) => match io::stdout().write_all(&packed) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("tamp-pack: cannot write: {error}");
                ExitCode::FAILURE
            }
        },
        Err(code) => {
            eprintln!("tamp-pack: tamp's error {code}");
            ExitCode::FAILURE
        }
    }
}
