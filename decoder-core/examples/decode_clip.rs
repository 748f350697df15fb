//! Decodes a clip and prints its frames as CSV: a column a channel, in degrees and centimetres.
//!
//! `cargo run -p decoder-core --example decode_clip -- FILE`, where FILE is a .mclip or a .qmd. Without a file it
//! decodes the clip beside this program.

use decoder_core::mclip::{self, Workspace};
use decoder_core::{I16F16, Limits, qmd};
use std::error::Error;
use std::io::{self, BufWriter, Write};
use std::{env, fs, process};

/// The clip that is decoded where none is named.
const CLIP: &[u8] = include_bytes!("clip.mclip");

/// What this program is ready to hold: channels, words and halves of words. A microcontroller's would be smaller.
type Memory = Workspace<1024, 4096, 65536>;

fn main() {
    if let Err(error) = decode() {
        eprintln!("decode_clip: {error}");
        process::exit(1);
    }
}

fn decode() -> Result<(), Box<dyn Error>> {
    let bytes = match env::args_os().nth(1) {
        Some(path) => fs::read(path)?,
        None => CLIP.to_vec(),
    };
    let mut out = BufWriter::new(io::stdout().lock());
    if bytes.starts_with(&mclip::MAGIC) {
        mclip(&bytes, &mut out)?;
    } else {
        qmd(&bytes, &mut out)?;
    }
    Ok(out.flush()?)
}

/// A clip in blocks, which names its channels.
fn mclip(bytes: &[u8], out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    // All checks that take time in proportion to the clip are done once, here.
    let clip = mclip::Clip::parse(bytes, Limits::MAX)?.verify()?;
    let names: Vec<String> = clip.header().channels().map(|channel| channel.to_string()).collect();
    writeln!(out, "{}", names.join(","))?;
    let mut memory = Box::new(Memory::EMPTY);
    let mut decoder = clip.decoder(memory.lend())?;
    while let Some(pose) = decoder.next_frame()? {
        row(pose, out)?;
    }
    Ok(())
}

/// A clip of QMD, which numbers its channels.
fn qmd(bytes: &[u8], out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    let clip = qmd::Clip::parse(bytes, Limits::MAX)?;
    let names: Vec<String> = (0..clip.channels()).map(|channel| channel.to_string()).collect();
    writeln!(out, "{}", names.join(","))?;
    let mut pose = vec![I16F16::ZERO; clip.channels()];
    let mut decoder = clip.decoder(&mut pose, None)?;
    while let Some(pose) = decoder.next_frame() {
        row(pose, out)?;
    }
    Ok(())
}

fn row(pose: &[I16F16], out: &mut impl Write) -> io::Result<()> {
    let values: Vec<String> = pose.iter().map(|value| format!("{value:.4}")).collect();
    writeln!(out, "{}", values.join(","))
}
