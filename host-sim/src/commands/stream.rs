//! `bunraku stream`: a clip to a device block by block, while it plays.

use super::push::Port;
use anyhow::{Context, Result};
use firmware::link::message::Streaming;
use host_sim::files;
use host_sim::link::streaming::{Settings, StreamedClip, stream};
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Stream a clip to a device while it plays; nothing is written to its flash.
///
/// The device buffers some blocks ahead, and bridges what does not come. Where nobody streams any more it stops, as its puppet's
/// policy says, and reports the link as lost. Where frames were made up since the line is too slow for the clip, it says so.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku stream tcp:127.0.0.1:4100 dance.mclip")]
pub struct Args {
    #[command(flatten)]
    port: Port,
    /// The clip (.mclip).
    clip: PathBuf,
    /// Silence in ms after which the device takes the link for lost, even where the stream is there to its end; 0: it does not.
    #[arg(long, value_name = "MS", default_value_t = 1000)]
    hold: u16,
    /// Seconds for which a broken line is opened again.
    #[arg(long, value_name = "SECONDS", default_value_t = 5)]
    retry: u64,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let name = args.clip.display();
    let bytes = files::read(&args.clip)?;
    let parts = StreamedClip::new(&bytes).with_context(|| format!("{name} cannot be streamed"))?;
    let settings =
        Settings { hold_millis: args.hold, patience: Duration::from_secs(args.retry), plays: true };
    let key = args.port.key()?;
    let report = stream(args.port.line(key.as_ref()), &parts, settings, &mut |_| ())
        .with_context(|| format!("cannot stream {name}"))?;
    let (needs, carries) = (parts.bits_per_second().round(), report.bits_per_second().round());
    let Streaming { progress, counters } =
        report.last.and_then(|telemetry| telemetry.stream).unwrap_or_default();
    if args.json {
        let report = json!({
            "blocks": report.blocks, "breaks": report.breaks, "frames": progress.frames, "counters": counters,
            "clip_bits_per_second": needs, "line_bits_per_second": carries,
        });
        println!("{report:#}");
    } else {
        println!(
            "{name}: {} blocks; {} frames played, {} made up, {} eased; {} lines broke",
            report.blocks, counters.played, counters.concealed, counters.eased, report.breaks
        );
    }
    if counters.concealed > 0 && carries < needs {
        eprintln!(
            "warning: the clip needs {needs:.0} bits per second and the line carried {carries:.0}: take a faster line (--baud, as the device has it), or encode the clip in fewer bits"
        );
    }
    Ok(ExitCode::SUCCESS)
}
