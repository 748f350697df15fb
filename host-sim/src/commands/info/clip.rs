//! `bunraku info` of a compressed clip.

use crate::commands::input::is_mclip;
use anyhow::{Context, Result, bail};
use decoder_core::Limits;
use decoder_core::mclip::{self, ChannelKind};
use decoder_core::qmd::Clip;
use encoder::memory::OwnedMemory;
use host_sim::clip::{Clip as AnyClip, most_values};
use host_sim::cycle_limit::header_core;
use host_sim::files;
use host_sim::terminal;
use std::path::Path;

/// Prints what the clip holds.
pub fn print(file: &Path, list_channels: bool, json: bool) -> Result<()> {
    let bytes = files::read(file)?;
    if is_mclip(file) {
        return mclip(file, &bytes, list_channels, json);
    }
    let clip =
        Clip::parse(&bytes, Limits::MAX).with_context(|| format!("{} is not a QMD clip", file.display()))?;
    let layout = clip.layout();
    let fps = (layout.rate_centihertz > 0).then(|| f64::from(layout.rate_centihertz) / 100.0);
    let highest = clip.levels().iter().max().copied().unwrap_or(0);
    let pose_bytes = clip.channels() * 4;
    let table_bytes = layout.table_bytes();
    if json {
        let report = serde_json::json!({
            "codec": "qmd", "bytes": bytes.len(), "frames": clip.frames(), "channels": clip.channels(),
            "fps": fps, "fdf": layout.fixed_channels, "index_bits": layout.index_bits,
            "segments": clip.segments(), "row_bytes": layout.row_bytes(), "levels": clip.levels(),
            "pose_bytes": pose_bytes, "table_bytes": table_bytes,
        });
        println!("{report:#}");
        return Ok(());
    }
    println!("{}: QMD, {} bytes", file.display(), bytes.len());
    match fps {
        Some(fps) => {
            println!("  {} frames at {fps} fps, {:.2} s", clip.frames(), f64::from(clip.frames()) / fps);
        }
        None => println!("  {} frames, rate not recorded", clip.frames()),
    }
    println!(
        "  {} channels, of which {} fixed (FDF); levels 1 to {highest}",
        clip.channels(),
        layout.fixed_channels
    );
    println!("  {} bits an index (b), {} bytes a frame", layout.index_bits, layout.row_bytes());
    println!("  {} segments, each with a table of {} entries", clip.segments(), clip.table_len());
    println!(
        "  a decoder needs {pose_bytes} bytes for the pose, and is faster with {table_bytes} more for the table"
    );
    Ok(())
}

fn mclip(file: &Path, bytes: &[u8], list_channels: bool, json: bool) -> Result<()> {
    let name = file.display();
    let AnyClip::Mclip(clip) = AnyClip::headers(file, bytes)? else { bail!("{name} is not a sound mclip") };
    // Every checksum was looked at. Of frames only as many are decoded as the file's size suggests.
    let ranges = Ranges::of(&clip).with_context(|| format!("{name} is not a sound mclip"))?;
    let (header, fields) = (clip.header(), clip.header().fields());
    let fps = f64::from(fields.rate_numerator) / f64::from(fields.rate_denominator);
    let (codec, entropy) = (header.codec().id().name(), header.entropy().name());
    let seconds = f64::from(clip.frames()) / fps;
    let rate = bytes.len() as f64 * 8.0 / seconds;
    let range = |channel: usize| ranges.of_channels.get(channel).copied().unwrap_or_default();
    let unit = |kind: ChannelKind| if kind.is_rotation() { "degrees" } else { "cm" };
    let cycles: Vec<(String, u32)> = fields
        .cycles
        .as_chunks::<5>()
        .0
        .iter()
        .map(|&[core, a, b, c, d]| {
            let name =
                header_core(core).map_or_else(|| format!("core {core}"), |core| core.name().to_owned());
            (name, u32::from_le_bytes([a, b, c, d]))
        })
        .collect();
    if json {
        let channels: Vec<_> = header
            .channels()
            .enumerate()
            .map(|(index, channel)| {
                let (low, high) = range(index);
                serde_json::json!({
                    "name": channel.to_string(), "unit": unit(channel.kind), "low": low,
                    "high": high, "bits": channel.bits, "step": channel.step,
                    "group": channel.group, "entry_bits": channel.entry_bits,
                    "coefficient": channel.coefficient,
                })
            })
            .collect();
        let report = serde_json::json!({
            "container": "mclip", "codec": codec, "entropy": entropy, "bytes": bytes.len(),
            "header_bytes": clip.header_bytes(), "frames": clip.frames(), "fps": fps, "bits_per_s": rate,
            "blocks": clip.block_count(), "entries": clip.entry_count(), "block_bytes": fields.block_bytes,
            "ram": fields.ram, "delay": fields.delay, "parameter_bytes": fields.parameters.len(),
            "table_bytes": fields.tables.len(), "cycles": cycles, "ranges_of_frames": ranges.frames,
            "channels": channels,
        });
        println!("{report:#}");
        return Ok(());
    }
    println!("{name}: mclip, {codec} in {entropy} codes, {} bytes, {rate:.0} bits/s", bytes.len());
    println!("  {} frames at {fps} fps, {seconds:.2} s; delay {} frames", clip.frames(), fields.delay);
    println!(
        "  header {} bytes, of which {} code tables and {} parameters of the codec",
        clip.header_bytes(),
        fields.tables.len(),
        fields.parameters.len()
    );
    println!(
        "  {} blocks of up to {} bytes, {} of them entry points",
        clip.block_count(),
        fields.block_bytes,
        clip.entry_count()
    );
    println!("  a decoder needs {} bytes of memory", fields.ram);
    for (core, cycles) in &cycles {
        println!("  at most {cycles} cycles a frame on {core}");
    }
    let resting = header.channels().filter(|channel| channel.bits == 0).count();
    println!("  {} channels, of which {resting} rest", clip.channels());
    if ranges.frames < clip.frames() {
        println!(
            "  much longer than its size suggests: only the first {} frames were decoded",
            ranges.frames
        );
    }
    if list_channels {
        println!("  channel            bits  step   low        high");
        for (index, channel) in header.channels().enumerate() {
            let (low, high) = range(index);
            let unit = unit(channel.kind);
            println!(
                "  {:<18} {:>4} {:>5} {low:>10.3} {high:>10.3} {unit}",
                terminal::name(&channel.to_string()),
                channel.bits,
                channel.step
            );
        }
    }
    Ok(())
}

/// Lowest and highest values.
struct Ranges {
    of_channels: Vec<(f64, f64)>,
    /// Of how many frames they are.
    frames: u32,
}

impl Ranges {
    fn of(clip: &mclip::Clip<'_>) -> Result<Self, decoder_core::Error> {
        let mut memory = OwnedMemory::new(clip.header().needs());
        let mut decoder = clip.decoder(memory.lend())?;
        let most = most_values(clip.bytes().len()) / clip.channels().max(1) as u64;
        let mut ranges =
            Self { of_channels: vec![(f64::INFINITY, f64::NEG_INFINITY); clip.channels()], frames: 0 };
        while u64::from(ranges.frames) < most
            && let Some(pose) = decoder.next_frame()?
        {
            for ((low, high), value) in ranges.of_channels.iter_mut().zip(pose) {
                let value = value.to_num::<f64>();
                (*low, *high) = (low.min(value), high.max(value));
            }
            ranges.frames += 1;
        }
        Ok(ranges)
    }
}
