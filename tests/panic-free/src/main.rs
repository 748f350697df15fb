//! Calls everything that decoder-core offers, on inputs that the compiler knows nothing of.
//!
//! `tests/tests/panic_free.rs` links this for Cortex-M with overflow checks on and looks through its symbols: a
//! panic that the optimiser could not rule out would leave `core::panicking` in the image. Inputs come through
//! volatile reads, or link-time optimisation would fold the decoder away and the check would prove nothing.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;
use core::ptr::{addr_of, addr_of_mut};
use decoder_core::qmd::{Clip, Stream};
use decoder_core::{I16F16, Limits, mclip, word};

static mut BYTES: [u8; 4096] = [0; 4096];
static mut POSE: [I16F16; 64] = [I16F16::ZERO; 64];
static mut TABLE: [i32; 256] = [0; 256];
static mut BUFFER: [u8; 256] = [0; 256];
static mut BLOCK: [u8; 256] = [0; 256];
static mut HALVES: [u16; 1024] = [0; 1024];
static mut WORDS: [u32; 256] = [0; 256];
static mut STATES: [mclip::State; 64] = [mclip::State::EMPTY; 64];
static mut NUMBERS: [u32; 8] = [0; 8];

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}

/// A number that the compiler cannot know.
fn number(index: usize) -> u32 {
    // SAFETY: callers pass constants below the array's length; nothing else runs.
    unsafe { addr_of!(NUMBERS).cast::<u32>().add(index).read_volatile() }
}

/// A slice of a static, with a length that the compiler cannot know and that is cut to the array's.
fn lend<T, const N: usize>(array: *mut [T; N], length: u32) -> &'static mut [T] {
    let length = (length as usize).min(N);
    // SAFETY: each static is lent to one user at a time, and nothing else runs.
    unsafe { core::slice::from_raw_parts_mut(array.cast::<T>(), length) }
}

#[unsafe(no_mangle)]
extern "C" fn entry() -> ! {
    loop {
        let limits = Limits { channels: number(0) as u16, frames: number(1) };
        black_box(word::fixed_from_f32_bits(number(2)));
        let _ = black_box(in_memory(limits));
        let _ = black_box(streamed(limits));
        let _ = black_box(mclip_in_memory(limits));
        let _ = black_box(mclip_streamed(limits));
        #[cfg(feature = "planted")]
        assert!(number(7) != 1, "planted");
    }
}

fn in_memory(limits: Limits) -> Result<u32, decoder_core::Error> {
    let clip = Clip::parse(lend(addr_of_mut!(BYTES), number(3)), limits)?;
    black_box((clip.layout(), clip.segments(), clip.frames(), clip.levels(), clip.layout().row_bytes()));
    let table = (number(4) != 0).then(|| lend(addr_of_mut!(TABLE), number(4)));
    let mut decoder = clip.decoder(lend(addr_of_mut!(POSE), number(5)), table)?;
    while let Some(pose) = decoder.next_frame() {
        black_box(pose);
    }
    black_box(decoder.seek(number(6)));
    decoder.rewind();
    Ok(decoder.position())
}

fn streamed(limits: Limits) -> Result<u32, decoder_core::Error> {
    let mut stream = Stream::new(
        limits,
        lend(addr_of_mut!(POSE), number(5)),
        lend(addr_of_mut!(TABLE), number(4)),
        lend(addr_of_mut!(BUFFER), number(6)),
    );
    let mut chunk: &[u8] = lend(addr_of_mut!(BYTES), number(3));
    while let Some(pose) = stream.next_frame(&mut chunk)? {
        black_box(pose);
    }
    black_box(stream.layout());
    stream.finish()?;
    Ok(stream.frames())
}

fn mclip_memory() -> mclip::Memory<'static> {
    mclip::Memory {
        pose: lend(addr_of_mut!(POSE), number(5)),
        states: lend(addr_of_mut!(STATES), number(4)),
        words: lend(addr_of_mut!(WORDS), number(6)),
        halves: lend(addr_of_mut!(HALVES), number(7)),
    }
}

fn mclip_in_memory(limits: Limits) -> Result<u32, decoder_core::Error> {
    let clip = mclip::Clip::parse(lend(addr_of_mut!(BYTES), number(3)), limits)?;
    black_box((
        clip.header().rate_centihertz(),
        clip.block_count(),
        clip.entry_count(),
        clip.header().needs(),
    ));
    clip.header().channels().for_each(|channel| {
        black_box(channel);
    });
    let clip = if number(2) == 1 { clip.verify()? } else { clip };
    let mut decoder = clip.decoder(mclip_memory())?;
    while let Some(pose) = decoder.next_frame()? {
        black_box(pose);
    }
    black_box(decoder.seek(number(6))?);
    decoder.rewind();
    Ok(decoder.position())
}

fn mclip_streamed(limits: Limits) -> Result<u32, decoder_core::Error> {
    let mut chunk: &[u8] = lend(addr_of_mut!(BYTES), number(3));
    let mut receiver = mclip::Receiver::new(lend(addr_of_mut!(BUFFER), number(6)));
    if !receiver.receive(&mut chunk)? {
        return Ok(0);
    }
    let header = receiver.finish(limits)?;
    let mut stream = mclip::Stream::new(header, mclip_memory(), lend(addr_of_mut!(BLOCK), number(6)))?;
    while let Some(pose) = stream.next_frame(&mut chunk)? {
        black_box(pose);
    }
    stream.resume();
    black_box(stream.next_frame(&mut chunk)?);
    stream.finish()?;
    Ok(stream.position())
}
