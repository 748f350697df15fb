//! `bunraku demo`: the whole way of the data, on the embedded clip.

use super::play::write_log;
use anyhow::{Context, Result, bail};
use decoder_core::mclip::CodecId;
use encoder::mclip::{self, Encoder, Encoding, Target};
use encoder::qmd::{self, Method, Parameters};
use host_sim::clip::Clip;
use host_sim::filmstrip::filmstrip;
use host_sim::{files, play};
use mocap::export::amc::{self, Rotations};
use mocap::metrics::{self, Evaluator};
use mocap::motion::Motion;
use mocap::sample;
use puppet_file::Puppet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Encode, compare and play the embedded clip: a small puppet that walks and waves.
///
/// The clip comes from a formula, so no data is needed. All files on the way are kept, as examples.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku demo --output demo --qemu")]
pub struct Args {
    /// Folder for the files; it is made if it is not there.
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Also play on a Cortex-M4 in QEMU, and check that its servos are told the same.
    #[arg(long)]
    qemu: bool,
}

/// The mean joint error that is asked of dpcm, in cm.
const TARGET_CM: f64 = 0.1;

/// Figures in the picture.
const FIGURES: usize = 9;

/// The puppet of the embedded clip, which is also an example for people to start from.
const PUPPET: &str = include_str!("../../../puppets/sample.toml");

pub fn run(args: Args) -> Result<ExitCode> {
    let folder = args.output.as_path();
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let original = sample::clip();
    let (frames, channels) = (original.motion.frames(), original.motion.channels);
    println!(
        "A puppet of {} joints and {channels} channels walks and waves: {frames} frames at {} fps.\n",
        original.skeleton.joints.len(),
        original.motion.fps
    );
    save(folder, "puppet.asf", sample::asf().as_bytes())?;
    save(folder, "puppet.toml", PUPPET.as_bytes())?;
    files::write(&folder.join("walk.amc"), |mut file| {
        Ok(amc::write(&mut file, &original.skeleton, &original.motion, Rotations::AsTheyAre)?)
    })?;

    println!("                        bytes    mean joint error   worst joint");
    println!("float32               {:>7}", frames * channels * 4);
    encode(folder, "faithful.qmd", "QMD, paper's encoder", &original, Method::FAITHFUL)?;
    let bytes = encode(folder, "walk.qmd", "QMD, ours", &original, Method::ClosedLoop)?;
    encode_dpcm(folder, &original)?;

    let clip = Clip::parse(Path::new("walk.qmd"), &bytes)?;
    let path = folder.join("puppet.toml");
    let puppet = Puppet::read(&path)?;
    let (map, buses) = (puppet.map(&original.skeleton)?, puppet.bus_names());
    let host = play::on_host(&clip, &map, 0)?;
    write_log(&folder.join("host.csv"), &host, &buses)?;
    println!("\nThe player told {} virtual servos {} goal positions.", map.joints().len(), host.goals.len());
    if args.qemu {
        println!("Building the firmware, and playing on a Cortex-M4 in QEMU ...");
        let board = play::on_qemu(&clip, &bytes, &map, 0, &mut |line| println!("  {line}"))?;
        write_log(&folder.join("cortex-m4.csv"), &board, &buses)?;
        if board != host {
            bail!(
                "the Cortex-M4 told its servos something else: compare {0}/host.csv and {0}/cortex-m4.csv",
                folder.display()
            );
        }
        println!("The Cortex-M4 told them the same, goal by goal.");
    }
    println!("\nThe files are in {}.", folder.display());
    Ok(ExitCode::SUCCESS)
}

fn save(folder: &Path, name: &str, bytes: &[u8]) -> Result<()> {
    files::write(&folder.join(name), |file| Ok(file.write_all(bytes)?))
}

/// Encodes with the parameters of the paper's Table 1, prints how well that went, and gives the clip.
fn encode(folder: &Path, name: &str, title: &str, original: &mocap::Clip, method: Method) -> Result<Vec<u8>> {
    let bytes = qmd::encode(original, Parameters::TABLE_1, method)?;
    save(folder, name, &bytes)?;
    print_errors(title, original, &qmd::decode(&bytes)?, bytes.len())?;
    Ok(bytes)
}

/// Encodes with dpcm, prints how well that went, and draws the motion before and after.
fn encode_dpcm(folder: &Path, original: &mocap::Clip) -> Result<()> {
    let encoder = Encoder::new(&original.skeleton, &original.motion)?;
    let evaluator = Evaluator::new(&original.skeleton, &original.motion)?;
    let encoding = Encoding::new(CodecId::Dpcm);
    let bytes = encoder.encode_to(&encoding, Target::Error(TARGET_CM), &evaluator)?.bytes;
    save(folder, "walk.mclip", &bytes)?;
    let decoded = mclip::decode(&bytes)?;
    print_errors("dpcm, about 1 mm off", original, &decoded, bytes.len())?;
    let floats = original.motion.frames() * original.motion.channels * 4;
    let title = format!(
        "{} channels, {} frames. Grey: recorded, {floats} bytes. Red: decoded from {} bytes.",
        original.motion.channels,
        original.motion.frames(),
        bytes.len()
    );
    let svg = filmstrip(&original.skeleton, &original.motion, &decoded, FIGURES, &title)?;
    save(folder, "picture.svg", svg.as_bytes())
}

fn print_errors(title: &str, original: &mocap::Clip, decoded: &Motion, bytes: usize) -> Result<()> {
    let report = metrics::compare(&original.skeleton, &original.motion, decoded, bytes as u64)?;
    let (mean, worst) = (report.mean_joint_cm, report.max_joint_cm);
    println!("{title:<21} {bytes:>7}    {mean:>10.5} cm      {worst:>8.4} cm");
    Ok(())
}
