//! Files from anywhere: whatever is in them, each command that reads them ends within 5 seconds of one core and 200 MB, with
//! exit code 0 or with 1 and sentences, and leaves nothing behind but its output.
//!
//! Eight inputs are cut and changed. The short form takes twenty of each kind; `BUNRAKU_HOSTILE=10000` takes so many, which are all
//! truncations (docs/TESTING.md). Time and memory are limits that the system sets for each run of the command.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use bunraku_fuzz::Random;
use bunraku_fuzz::mclip::repair;
use bunraku_fuzz::mutate::mutate;
use bunraku_tests::bunraku;
use decoder_core::mclip::{CodecId, EntropyId};
use encoder::mclip::{Encoder, Encoding, Quality};
use encoder::qmd::{Method, Parameters};
use mocap::import::{self, Options};
use mocap::{Clip, export, sample};
use std::collections::BTreeSet;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// A figure of four joints in five frames.
const BVH: &str = "HIERARCHY\nROOT hips\n{\n  OFFSET 0 90 0\n  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation\n  \
    JOINT spine\n  {\n    OFFSET 0 30 0\n    CHANNELS 3 Zrotation Yrotation Xrotation\n    JOINT arm\n    {\n      OFFSET 20 10 0\n      \
    CHANNELS 1 Xrotation\n      End Site\n      {\n        OFFSET 25 0 0\n      }\n    }\n    JOINT head\n    {\n      OFFSET 0 20 0\n      \
    CHANNELS 1 Yrotation\n      End Site\n      {\n        OFFSET 0 20 0\n      }\n    }\n  }\n}\nMOTION\nFrames: 5\nFrame Time: 0.05\n\
    0 90 0 0 1 0 0 0 0 0 10\n1 90 0 0 2 0 0 0 3 5 11\n2 91 0 0 3 1 0 0 3 10 12\n3 91 0 0 4 1 0 0 2 15 13\n4 90 0 0 5 1 0 0 1 9 14\n";

const PUPPET: &str = "# Two servos.\nservo_hz = 50\nbaud = 1_000_000\nfade_seconds = 0.2\n\n[[joint]]\nname = \"arm\"\nchannel = \
    \"arm.rx\"\nid = 1\nmodel = \"XL330-M288\"\nidle = { sway = 0.5 }\nrange = [-30, 60]\nmax_speed = 200\n\n[[joint]]\nname = \"head\"\nchannel = \"head.ry\"\nid = 2\n\
    range = [-40.5, 40]\nmax_speed = 100\nmax_acceleration = 900\nzero = 2048\nhome = 0\n";

/// Something that is read: a file, and the commands that read it.
struct Target {
    /// The input that it is one of the files of.
    input: &'static str,
    name: &'static str,
    bytes: Vec<u8>,
    /// Whether checksums are put right in every second changed file: else nothing is seen behind the first check.
    sums: bool,
    commands: &'static [&'static [&'static str]],
}

/// The inputs, in a folder that has all of them as they should be.
fn targets(folder: &Path) -> Vec<Target> {
    let write = |name: &str, bytes: &[u8]| fs::write(folder.join(name), bytes).unwrap();
    write("good.bvh", BVH.as_bytes());
    write("good.toml", PUPPET.as_bytes());
    let options = Options { unit: Some("cm".parse().unwrap()), ..Options::default() };
    let clip = import::read(&folder.join("good.bvh"), &options).unwrap().clip;
    let Clip { skeleton, motion } = &clip;
    let exported = |name: &str, write: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = Vec::new();
        write(&mut bytes);
        fs::write(folder.join(name), &bytes).unwrap();
        bytes
    };
    let csv = exported("good.csv", &|out| export::csv::write(out, skeleton, motion).unwrap());
    let json = exported("good.json", &|out| export::servo_json::write(out, skeleton, motion).unwrap());
    let glb = exported("good.glb", &|out| export::glb::write(out, skeleton, motion).unwrap());
    let mut person = sample::clip();
    person.motion.samples.truncate(3 * person.motion.channels);
    let rotations = export::amc::Rotations::AsTheyAre;
    let amc = exported("good.amc", &|out| {
        export::amc::write(out, &person.skeleton, &person.motion, rotations).unwrap();
    });
    write("good.asf", sample::asf().as_bytes());
    let encoder = Encoder::new(skeleton, motion).unwrap();
    let encoded = |codec, entropy| {
        let encoding = Encoding { entropy: Some(entropy), entry_frames: 3, ..Encoding::new(codec) };
        encoder.encode(&encoding, Quality::Bits(5)).unwrap()
    };
    let dpcm = encoded(CodecId::Dpcm, EntropyId::Huffman);
    let adpcm = encoded(CodecId::Adpcm, EntropyId::AdaptiveHuffman);
    write("good.mclip", &dpcm);
    let qmd = encoder::qmd::encode(&clip, Parameters::TABLE_1, Method::ClosedLoop).unwrap();
    let target = |input, name, bytes, commands| Target { input, name, bytes, sums: false, commands };
    let mclip: &[&[&str]] = &[
        &["info", "in.mclip", "--channels"],
        &["compare", "good.bvh", "in.mclip", "--unit", "cm"],
        &["decode", "in.mclip", "-o", "out.csv"],
        &["play", "in.mclip", "--puppet", "good.toml", "--log", "out.csv"],
        &["puppet", "check", "good.toml", "--clip", "in.mclip"],
    ];
    vec![
        target(
            "BVH",
            "in.bvh",
            BVH.into(),
            &[
                &["info", "in.bvh"],
                &["compare", "in.bvh", "good.mclip", "--unit", "cm"],
                &["encode", "in.bvh", "--bits", "5", "-o", "out.mclip"],
            ],
        ),
        target(
            "AMC and ASF",
            "in.amc",
            amc,
            &[
                &["info", "in.amc", "--skeleton", "good.asf"],
                &["compare", "good.amc", "in.amc", "--skeleton", "good.asf"],
                &["encode", "in.amc", "--skeleton", "good.asf", "-o", "out.qmd"],
            ],
        ),
        target(
            "AMC and ASF",
            "in.asf",
            sample::asf().into_bytes(),
            &[
                &["info", "in.asf"],
                &["compare", "good.amc", "good.amc", "--skeleton", "in.asf"],
                &["encode", "good.amc", "--skeleton", "in.asf", "-o", "out.qmd"],
            ],
        ),
        target(
            "CSV",
            "in.csv",
            csv,
            &[
                &["info", "in.csv"],
                &["compare", "in.csv", "good.csv"],
                &["encode", "in.csv", "--bits", "5", "-o", "out.mclip"],
            ],
        ),
        target(
            "JSON",
            "in.json",
            json,
            &[
                &["info", "in.json"],
                &["compare", "good.json", "in.json"],
                &["encode", "in.json", "--bits", "5", "-o", "out.mclip"],
            ],
        ),
        target(
            "GLB",
            "in.glb",
            glb,
            &[
                &["info", "in.glb"],
                &["compare", "good.glb", "in.glb"],
                &["encode", "in.glb", "--bits", "5", "-o", "out.mclip"],
            ],
        ),
        Target { sums: true, ..target(".mclip, dpcm", "in.mclip", dpcm, mclip) },
        Target { sums: true, ..target(".mclip, adpcm", "in.mclip", adpcm, mclip) },
        target(
            ".qmd",
            "in.qmd",
            qmd,
            &[
                &["info", "in.qmd"],
                &["compare", "good.bvh", "in.qmd", "--unit", "cm"],
                &["decode", "in.qmd", "--skeleton", "good.bvh", "--unit", "cm", "-o", "out.bvh"],
                &["play", "in.qmd", "--puppet", "good.toml", "--skeleton", "good.bvh", "--log", "out.csv"],
                &["puppet", "check", "good.toml", "--clip", "in.qmd", "--skeleton", "good.bvh"],
            ],
        ),
        target(
            "puppet.toml",
            "in.toml",
            PUPPET.into(),
            &[
                &["info", "in.toml"],
                &["puppet", "check", "in.toml", "--clip", "good.mclip"],
                &["play", "good.mclip", "--puppet", "in.toml", "--log", "out.csv"],
            ],
        ),
    ]
}

/// What came out of the runs of one input.
#[derive(Default)]
struct Counts {
    cut: usize,
    changed: usize,
    runs: usize,
    refused: usize,
    slowest: Duration,
}

/// Runs every command that reads the target's file in `folder`, in which this is that file now.
fn run(folder: &Path, target: &Target, bytes: &[u8], counts: &mut Counts) {
    fs::write(folder.join(target.name), bytes).unwrap();
    let before = names(folder);
    for arguments in target.commands {
        let start = Instant::now();
        // Kilobytes of writable memory, and seconds of one core.
        let mut limited = Command::new("sh");
        limited.args([
            "-c",
            "ulimit -d 204800 -t 5 2>/dev/null || { ulimit -d 204800; ulimit -t 5; }; exec \"$0\" \"$@\"",
        ]);
        let output =
            limited.arg(bunraku().get_program()).args(*arguments).current_dir(folder).output().unwrap();
        counts.slowest = counts.slowest.max(start.elapsed());
        counts.runs += 1;
        let Output { status, stderr, .. } = output;
        let said = String::from_utf8(stderr).unwrap();
        let wrong = match status.code() {
            Some(0) => None,
            Some(1) => {
                counts.refused += 1;
                not_sentences(&said)
            }
            _ => Some(format!("exit code {:?}, signal {:?}", status.code(), status.signal())),
        };
        // The log of a player is written also where playing fails.
        let is_new = |name: &String| name.starts_with("out.") && (status.success() || arguments[0] == "play");
        let left: Vec<String> =
            names(folder).difference(&before).filter(|name| !is_new(name)).cloned().collect();
        let wrong = wrong.or_else(|| (!left.is_empty()).then(|| format!("it left {left:?}")));
        if let Some(wrong) = wrong {
            let kept = std::env::temp_dir().join(format!("hostile-{}", target.name));
            fs::write(&kept, bytes).unwrap();
            panic!("{arguments:?} of {}: {wrong}; it said {said:?}", kept.display());
        }
        for name in names(folder).difference(&before) {
            fs::remove_file(folder.join(name)).unwrap();
        }
    }
}

/// Why what a command said when it refused a file is not what it should say.
fn not_sentences(said: &str) -> Option<String> {
    let lines: Vec<&str> = said.lines().collect();
    let is_sentence = |line: &str| {
        line.starts_with("bunraku: ") && line.len() < 1200 && !line.chars().any(char::is_control)
    };
    match lines.iter().find(|line| !is_sentence(line)) {
        _ if lines.is_empty() => Some("no word".to_owned()),
        // What was guessed of the file, and then what is wrong with it: of a puppet every mistake.
        _ if lines.len() > 20 => Some(format!("{} lines", lines.len())),
        Some(line) => Some(format!("no sentence: {line:?}")),
        None => None,
    }
}

fn names(folder: &Path) -> BTreeSet<String> {
    let files = fs::read_dir(folder).unwrap();
    files.map(|file| file.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn no_file_is_too_much_for_a_command() {
    let each = std::env::var("BUNRAKU_HOSTILE")
        .map_or(20, |each| each.parse::<usize>().expect("BUNRAKU_HOSTILE: a number"));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let counts: Mutex<Vec<(&'static str, Counts)>> = Mutex::default();
    std::thread::scope(|scope| {
        for thread in 0..threads {
            let counts = &counts;
            scope.spawn(move || {
                let folder = tempfile::tempdir().unwrap();
                for target in targets(folder.path()) {
                    let mut own = Counts::default();
                    run(folder.path(), &target, &target.bytes, &mut own);
                    assert_eq!(own.refused, 0, "{} as it should be", target.name);
                    // Of an input of two files each has its share.
                    let share = if target.input == "AMC and ASF" { 2 } else { 1 };
                    let stride = (target.bytes.len() / (each / share)).max(1);
                    for length in (0..target.bytes.len()).step_by(stride).skip(thread).step_by(threads) {
                        run(folder.path(), &target, &target.bytes[..length], &mut own);
                        own.cut += 1;
                    }
                    for number in (0..each / share).skip(thread).step_by(threads) {
                        let mut random = Random::new(number as u64 + 1);
                        let mut bytes = target.bytes.clone();
                        mutate(&mut bytes, &target.bytes, &mut random);
                        if target.sums && number % 4 > 0 {
                            repair(&mut bytes);
                        }
                        run(folder.path(), &target, &bytes, &mut own);
                        own.changed += 1;
                    }
                    counts.lock().unwrap().push((target.input, own));
                    fs::remove_file(folder.path().join(target.name)).unwrap();
                }
            });
        }
    });
    let counts = counts.into_inner().unwrap();
    let inputs: BTreeSet<&str> = counts.iter().map(|(input, _)| *input).collect();
    for input in inputs {
        let of_it = || counts.iter().filter(|(name, _)| *name == input).map(|(_, counts)| counts);
        let sum = |part: fn(&Counts) -> usize| of_it().map(part).sum::<usize>();
        let slowest = of_it().map(|counts| counts.slowest).max().unwrap_or_default();
        let (runs, refused) = (sum(|counts| counts.runs), sum(|counts| counts.refused));
        println!(
            "{input:<14} {:>6} cut, {:>6} changed, {runs:>7} runs, {refused:>7} refused, slowest {:.2} s",
            sum(|counts| counts.cut),
            sum(|counts| counts.changed),
            slowest.as_secs_f64()
        );
        // Else nothing behind the first check was seen, or nothing was checked.
        assert!(refused > 0 && refused < runs, "{input}: {refused} of {runs} refused");
    }
}
