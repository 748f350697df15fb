//! Whole images on the simulated cores: they decode the same frames as everything else, and fast.
#![allow(clippy::unwrap_used)]

use bunraku_tests::vectors::Vector;
use bunraku_tests::{cargo, require_target, vectors};
use std::fs;
use std::time::{Duration, Instant};
use thumb_cycles::{Board, Core, Image, Machine, Usage};

fn image(target: &str, binary: &str) -> Option<Image> {
    if !require_target(target) {
        return None;
    }
    let path = cargo::image("on-target", binary, target, "firmware", &[]);
    Some(Image::parse(&fs::read(path).unwrap()).unwrap())
}

/// Runs the image on a clip, which it decodes to the right frames. Gives what it took.
fn run(image: &Image, core: Core, board: &Board, clip: &Vector) -> (Usage, Duration) {
    let mut machine = Machine::new(core, board, image).unwrap();
    machine.semihosting.files.insert("clip".to_owned(), clip.bytes.clone());
    machine.semihosting.command_line = "clip".to_owned();
    let mut said = Vec::new();
    let started = Instant::now();
    let code = machine
        .run_to_exit(&mut |_| Vec::new(), &mut |bytes| said.extend_from_slice(bytes), u64::MAX)
        .unwrap_or_else(|fault| panic!("{}: {fault}", core.name()));
    let time = started.elapsed();
    let said = String::from_utf8(said).unwrap();
    assert_eq!(code, Some(0), "{}: {said}", core.name());
    assert_eq!(said.trim_end(), clip.sha256, "{} on {}", clip.name, core.name());
    (machine.usage(), time)
}

#[test]
fn every_core_decodes_the_golden_frames() {
    let small = [(Core::M0, "stream"), (Core::M0Plus, "stream"), (Core::M0PlusSlow, "stream")];
    let large =
        [(Core::M3, "in-place"), (Core::M4, "in-place"), (Core::M7, "in-place"), (Core::M33, "in-place")];
    for ((core, binary), board) in
        small.map(|row| (row, Board::microbit())).into_iter().chain(large.map(|row| (row, Board::mps2())))
    {
        let Some(image) = image(core.target(), binary) else { continue };
        for clip in vectors::all() {
            let (usage, _) = run(&image, core, &board, &clip);
            println!("{}: {} in {} cycles", core.name(), clip.name, usage.cycles);
        }
    }
}

#[test]
fn an_m4_decodes_real_motion() {
    let Some(image) = image(Core::M4.target(), "in-place") else { return };
    for clip in vectors::with_trials() {
        run(&image, Core::M4, &Board::mps2(), &clip);
    }
}

#[test]
fn runs_are_alike_and_timing_is_cheap() {
    let Some(image) = image(Core::M4.target(), "in-place") else { return };
    let clip = vectors::with_trials().into_iter().find(|clip| clip.name == "sample").unwrap();
    // The best of some runs: other tests run beside this one.
    let measure = |core: Core| {
        let runs = [(); 5].map(|()| run(&image, core, &Board::mps2(), &clip));
        assert!(runs.iter().all(|(usage, _)| *usage == runs[0].0), "{runs:?}");
        let time = runs.iter().map(|&(_, time)| time).min().unwrap();
        (runs[0].0.instructions, time.as_secs_f64())
    };
    let (instructions, untimed) = measure(Core::Untimed);
    let speed = |time: f64| instructions as f64 / time / 1e6;
    println!("untimed: {:.1} M instructions/s", speed(untimed));
    // The image has instructions that an M3 has not.
    for core in [Core::M4, Core::M7] {
        let (executed, time) = measure(core);
        println!(
            "{}: {:.1} M instructions/s, {:.2} times the time",
            core.name(),
            speed(time),
            time / untimed
        );
        assert_eq!(executed, instructions);
        assert!(time < 3.0 * untimed, "{} takes {time} s, untimed {untimed} s", core.name());
    }
}
