//! What each codec costs on simulated cores: the same frames as here, and cycles within a budget.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{budgets, bunraku, motion, require_target};
use decoder_core::Limits;
use decoder_core::codec::adpcm::Adaptation;
use decoder_core::mclip::{Clip, CodecId, EntropyId};
use encoder::codec::CodecSettings;
use encoder::codec::adpcm::{Adpcm, StepRule};
use encoder::codec::dpcm::{Dpcm, Order};
use encoder::mclip::{Encoder, Encoding, Quality};
use encoder::memory::OwnedMemory;
use host_sim::profile::measure::Runner;
use host_sim::profile::{LoadedImage, mclip_images, prefix_images};
use mocap::import;
use thumb_cycles::Core;

/// Decodes on the simulated core, compares every frame, and gives the mean cycles of a frame and the worst one's.
fn cycles(core: Core, image: &LoadedImage, bytes: &[u8]) -> (f64, u64) {
    let clip = Clip::parse(bytes, Limits::MAX).unwrap();
    let mut memory = OwnedMemory::new(clip.header().needs());
    let mut decoder = clip.decoder(memory.lend()).unwrap();
    let mut runner = Runner::new(core, image, 0).unwrap();
    while let Some(expected) = decoder.next_frame().unwrap() {
        let expected: Vec<u8> = expected.iter().flat_map(|value| value.to_bits().to_le_bytes()).collect();
        assert_eq!(runner.next_frame(4).unwrap(), Some(expected.as_slice()));
    }
    assert_eq!(runner.next_frame(4).unwrap(), None);
    let cycles = runner.finish().frame_cycles;
    let mean = cycles.iter().sum::<u64>() as f64 / cycles.len() as f64;
    (mean, cycles.iter().copied().max().unwrap_or(0))
}

/// A clip to decode: what it is called, its settings, and whether blocks are checked as they are entered.
struct Case {
    name: &'static str,
    encoding: Encoding,
    bits: u8,
    verify_blocks: bool,
}

const fn case(name: &'static str, encoding: Encoding, bits: u8) -> Case {
    Case { name, encoding, bits, verify_blocks: false }
}

/// The walk of 62 channels, by every codec.
#[test]
fn a_frame_of_62_channels_is_within_its_budget() {
    if !TARGETS.iter().all(|target| require_target(target)) {
        return;
    }
    let Some(folder) = motion() else { return };
    let file = |name: &str| folder.join("cmu").join(name);
    let clip = import::load(&file("02_01.amc"), Some(&file("02.asf")), None).unwrap();
    let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
    let with =
        |entropy, settings: CodecSettings| Encoding { entropy: Some(entropy), ..Encoding::of(settings) };
    let of = |settings| with(EntropyId::FixedWidth, settings);
    let fixed = |codec| of(CodecSettings::new(codec));
    let first = CodecSettings::from(Dpcm { order: Order::First, ..Dpcm::default() });
    let stepping = Adpcm { predictor: None, step: StepRule::Trained, ..Adpcm::default() }.into();
    let window = |window, period| {
        of(Adpcm { predictor: Some(Adaptation { window, period }), ..Adpcm::default() }.into())
    };
    let cases = [
        case("pcm, 6 bits", fixed(CodecId::Pcm), 6),
        case("dpcm, order 1, 4 bits", of(first), 4),
        case("dpcm, order 1, 6 bits", of(first), 6),
        case("dpcm, order 1, 8 bits", of(first), 8),
        Case { verify_blocks: true, ..case("dpcm, order 1, 8 bits, checking blocks", of(first), 8) },
        case("dpcm, order 2, 6 bits", fixed(CodecId::Dpcm), 6),
        case("adpcm, adaptive step, order 2, 4 bits", of(stepping), 4),
        case("adpcm, adaptive predictor, exponential window, 6 bits", window(5, 4), 6),
        case("adpcm, adaptive predictor, window of 16 every 16 frames, 6 bits", window(16, 4), 6),
        case("adpcm, adaptive predictor, window of 16 every 32 frames, 6 bits", window(16, 5), 6),
        case("adpcm, adaptive predictor, window of 16 every 64 frames, 6 bits", window(16, 6), 6),
        case("adpcm, adaptive predictor, window of 120 every 16 frames, 6 bits", window(120, 4), 6),
        case("mulaw, 6 bits", fixed(CodecId::MuLaw), 6),
        case("qmd, 4 bits", fixed(CodecId::Qmd), 4),
        case("dpcm, order 1, 6 bits, Huffman", with(EntropyId::Huffman, first), 6),
        case("dpcm, order 1, 6 bits, adaptive Huffman", with(EntropyId::AdaptiveHuffman, first), 6),
    ];
    let mut measured = Vec::new();
    for Case { name, encoding, bits, verify_blocks } in cases {
        let bytes = encoder.encode(&encoding, Quality::Bits(bits)).unwrap();
        let images = mclip_images(&bytes, &TARGETS, verify_blocks).unwrap();
        let found: Vec<(f64, u64)> =
            CORES.iter().zip(&images).map(|(&core, image)| cycles(core, image, &bytes)).collect();
        for (core, (mean, worst)) in ["cortex-m4", "cortex-m0plus"].iter().zip(found) {
            measured.push((format!("{name}: {core}, mean cycles of a frame"), mean));
            measured.push((format!("{name}: {core}, worst cycles of a frame"), worst as f64));
        }
    }
    budgets::check(&measured);
}

/// The same prefix codes by the decoder's table and bit by bit, in one run of one image.
#[test]
fn the_table_is_several_times_as_fast_as_bit_by_bit() {
    if !TARGETS.iter().all(|target| require_target(target)) {
        return;
    }
    let images = prefix_images(&TARGETS).unwrap();
    for (core, image) in CORES.into_iter().zip(&images) {
        let mut runner = Runner::new(core, image, 0).unwrap();
        let mut frames: Vec<Vec<u8>> = Vec::new();
        while let Some(codes) = runner.next_frame(4).unwrap() {
            frames.push(codes.to_vec());
        }
        assert!(frames.len() == 16 && frames.chunks(2).all(|pair| pair[0] == pair[1]), "both decode alike");
        assert!(frames.windows(3).all(|frames| frames[0] != frames[2]), "other codes in each turn");
        let functions = runner.finish().functions;
        let cycles = |part: &str| {
            functions.iter().filter(|f| f.name.contains(part)).map(|f| f.cycles as f64).sum::<f64>()
        };
        let count = (frames.len() / 2 * frames[0].len() / 4) as f64;
        let (table, serial) = (cycles("by_table") / count, cycles("bit_by_bit") / count);
        println!(
            "{core:?}: {table:.1} cycles a code by the table, {serial:.1} bit by bit, {:.2} times",
            serial / table
        );
        budgets::check(&[(format!("prefix codes: {core:?}, cycles a code by the table"), table)]);
        assert!(serial >= LEAST_RATIO * table, "{core:?}: {table} and {serial} cycles a code");
    }
}

#[test]
fn a_limit_of_cycles_is_kept_and_certified() {
    if !require_target(TARGETS[0]) {
        return;
    }
    let Some(folder) = motion() else { return };
    let (cmu, out) = (folder.join("cmu"), tempfile::tempdir().unwrap());
    let path = out.path().join("clip.mclip");
    let encode = |limit: &str| {
        let mut command = bunraku();
        command.arg("encode").arg(cmu.join("02_01.amc")).arg("--skeleton").arg(cmu.join("02.asf"));
        command
            .args(["--codec", "dpcm", "--target-error", "0.1", "--max-cycles", limit])
            .arg("-o")
            .arg(&path);
        command.output().unwrap()
    };
    let refused = encode("300");
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(
        said.contains("the fewest cycles of a worst frame on cortex-m4 are ") && !path.exists(),
        "{said}"
    );
    assert!(encode("5000").status.success());
    let report = |command: &str| -> serde_json::Value {
        let output = bunraku().arg(command).arg(&path).arg("--json").output().unwrap();
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let certified = &report("info")["cycles"][0];
    assert_eq!(certified[0], "cortex-m4");
    // `profile` counts the same, without having been told.
    let core = report("profile")["cores"]
        .as_array()
        .unwrap()
        .iter()
        .find(|core| core["core"] == "cortex-m4")
        .cloned();
    assert_eq!(core.unwrap()["cycles_max"], certified[1]);
    assert!((1000..=5000).contains(&certified[1].as_u64().unwrap()), "{certified}");
}

const TARGETS: [&str; 2] = ["thumbv7em-none-eabi", "thumbv6m-none-eabi"];

const CORES: [Core; 2] = [Core::M4, Core::M0Plus];

/// How many times as fast the table is at least.
const LEAST_RATIO: f64 = 3.0;
