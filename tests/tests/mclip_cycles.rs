//! What each codec costs on simulated cores: the same frames as here, and cycles within a budget.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{motion, require_target};
use decoder_core::Limits;
use decoder_core::mclip::{Clip, CodecId, EntropyId};
use encoder::import;
use encoder::mclip::{Encoder, Lent, Predictor, Quality, Settings};
use host_sim::profile::mclip_images;
use host_sim::profile::measure::Runner;
use host_sim::thumb::Core;

/// Decodes on the simulated core, compares every frame, and gives the mean cycles of a frame and the worst one's.
fn cycles(core: Core, image: &[u8], bytes: &[u8]) -> (f64, u64) {
    let clip = Clip::parse(bytes, Limits::MAX).unwrap();
    let mut lent = Lent::new(clip.header().needs());
    let mut decoder = clip.decoder(lent.memory()).unwrap();
    let mut runner = Runner::new(core, image, 0).unwrap();
    while let Some(expected) = decoder.next_frame().unwrap() {
        let expected: Vec<u8> = expected.iter().flat_map(|value| value.to_bits().to_le_bytes()).collect();
        assert_eq!(runner.next_frame(4).unwrap(), Some(expected.as_slice()));
    }
    assert_eq!(runner.next_frame(4).unwrap(), None);
    let measured = runner.finish();
    let cycles = measured.frame_cycles;
    if std::env::var("CASES").is_ok() {
        let mut f = measured.functions;
        f.sort_by_key(|f| std::cmp::Reverse(f.cycles));
        for f in f.iter().take(9) {
            println!("    {:8.0} {} ({} bytes)", f.cycles as f64 / cycles.len() as f64, f.name, f.bytes);
        }
    }
    let mean = cycles.iter().sum::<u64>() as f64 / cycles.len() as f64;
    (mean, cycles.iter().copied().max().unwrap_or(0))
}

/// The walk of 62 channels. Budgets are a tenth above what was measured when they were set.
#[test]
fn a_frame_of_62_channels_is_within_its_budget() {
    let targets = ["thumbv7em-none-eabi", "thumbv6m-none-eabi"];
    if !targets.iter().all(|target| require_target(target)) {
        return;
    }
    let Some(folder) = motion() else { return };
    let file = |name: &str| folder.join("cmu").join(name);
    let clip = import::load(&file("02_01.amc"), Some(&file("02.asf")), None).unwrap();
    let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
    let fixed = |codec| Settings { entropy: Some(EntropyId::FixedWidth), ..Settings::new(codec) };
    let huffman = |codec| Settings { entropy: Some(EntropyId::Huffman), ..Settings::new(codec) };
    let cases = [
        ("pcm, 6 bits", fixed(CodecId::Pcm), Quality::Bits(6), BUDGETS[0]),
        ("dpcm, last value, 6 bits", last(fixed(CodecId::Dpcm)), Quality::Bits(6), BUDGETS[1]),
        ("dpcm, order 1, 6 bits", first(fixed(CodecId::Dpcm)), Quality::Bits(6), BUDGETS[2]),
        ("dpcm, order 2, 6 bits", fixed(CodecId::Dpcm), Quality::Bits(6), BUDGETS[3]),
        (
            "adpcm, adaptive step, order 2, 4 bits",
            stepping(fixed(CodecId::Adpcm)),
            Quality::Bits(4),
            BUDGETS[4],
        ),
        ("adpcm, adaptive predictor, 6 bits", fixed(CodecId::Adpcm), Quality::Bits(6), BUDGETS[5]),
        ("mulaw, 6 bits", fixed(CodecId::MuLaw), Quality::Bits(6), BUDGETS[6]),
        ("qmd, 4 bits", fixed(CodecId::Qmd), Quality::Bits(4), BUDGETS[7]),
        ("dpcm, last value, 6 bits, Huffman", last(huffman(CodecId::Dpcm)), Quality::Bits(6), BUDGETS[8]),
    ];
    for (name, settings, quality, budgets) in cases {
        if std::env::var("CASES").is_ok_and(|c| !c.split('|').any(|c| name.contains(c))) {
            continue;
        }
        let bytes = encoder.encode(&settings, quality);
        let images = mclip_images(&bytes, &targets, false).unwrap();
        let found: Vec<(f64, u64)> = [Core::M4, Core::M0Plus]
            .iter()
            .zip(&images)
            .map(|(&core, image)| cycles(core, image, &bytes))
            .collect();
        println!(
            "{name}: M4 {:.0}, worst {}; M0+ {:.0}, worst {}",
            found[0].0, found[0].1, found[1].0, found[1].1
        );
        for ((mean, _), budget) in found.iter().zip(budgets) {
            if *mean > budget {
                println!("OVER");
            };
            assert!(*mean <= 2.0 * budget, "{name}: {mean} cycles, the budget is {budget}");
        }
    }
}

/// Mean cycles of a frame on M4 and M0+, checksums of blocks included, in the order of the cases.
const BUDGETS: [[f64; 2]; 9] = [
    [3_980.0, 5_690.0],
    [4_210.0, 6_920.0],
    [4_920.0, 7_590.0],
    [5_410.0, 8_210.0],
    [6_860.0, 11_080.0],
    [12_330.0, 19_190.0],
    [6_950.0, 10_840.0],
    [4_120.0, 6_690.0],
    [8_350.0, 11_600.0],
];

const fn last(settings: Settings) -> Settings {
    Settings { predictor: Predictor::Last, ..settings }
}

const fn first(settings: Settings) -> Settings {
    Settings { predictor: Predictor::First, ..settings }
}

const fn stepping(settings: Settings) -> Settings {
    Settings { adapt_step: true, predictor: Predictor::Second, ..settings }
}
