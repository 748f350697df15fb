//! Whole images on the simulated Cortex-M: what they print and send is what they print and send under QEMU.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{cargo, require_target, vectors};
use host_sim::thumb::{Board, Core, Image, Machine};
use std::fs;
use std::time::Instant;

/// Runs the image on a clip; gives what it printed.
fn run(image: &Image, core: Core, board: &Board, clip: &[u8]) -> (String, Machine) {
    let mut machine = Machine::new(core, board, image).unwrap();
    machine.files.insert("clip".to_owned(), clip.to_vec());
    machine.command_line = "clip".to_owned();
    let mut said = Vec::new();
    let code = machine
        .run_to_exit(&mut |_| Vec::new(), &mut |bytes| said.extend_from_slice(bytes), u64::MAX)
        .unwrap_or_else(|fault| panic!("{}: {fault}", core.name()));
    let said = String::from_utf8(said).unwrap();
    assert_eq!(code, Some(0), "{}: {said}", core.name());
    (said, machine)
}

fn check(core: Core, board: &Board, target: &str, binary: &str) {
    if !require_target(target) {
        return;
    }
    let path = cargo::image("on-target", binary, target, "firmware", &[]);
    let image = Image::parse(&fs::read(path).unwrap()).unwrap();
    for vector in vectors::with_trials() {
        let started = Instant::now();
        let (said, machine) = run(&image, core, board, &vector.bytes);
        assert_eq!(said.trim_end(), vector.sha256, "{} on {}", vector.name, core.name());
        let usage = machine.usage();
        let seconds = started.elapsed().as_secs_f64();
        println!(
            "{} on {}: {} instructions, {} cycles, {:.1} M instructions/s",
            vector.name,
            core.name(),
            usage.instructions,
            usage.cycles,
            usage.instructions as f64 / seconds / 1e6
        );
    }
}

#[test]
fn on_an_m0plus() {
    check(Core::M0Plus, &Board::microbit(), "thumbv6m-none-eabi", "stream");
}

#[test]
fn on_an_m3() {
    check(Core::M3, &Board::mps2(), "thumbv7m-none-eabi", "in-place");
}

#[test]
fn on_an_m4() {
    check(Core::M4, &Board::mps2(), "thumbv7em-none-eabi", "in-place");
    check(Core::Untimed, &Board::mps2(), "thumbv7em-none-eabi", "in-place");
}

#[test]
fn on_an_m7() {
    check(Core::M7, &Board::mps2(), "thumbv7em-none-eabi", "in-place");
}
