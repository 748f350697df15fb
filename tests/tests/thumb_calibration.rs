//! Simulated cycles against cycles that others have measured on real chips, or count with a simulator of their own.
//!
//! `cargo test -p bunraku-tests --test thumb_calibration -- --nocapture` prints the figures of docs/CYCLES.md.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{cargo, npm_package, require_program, require_target};
use std::fs;
use std::process::Command;
use thumb_cycles::{Board, Core, Image, Machine, Stop, WaitStates};

/// More than any of these takes.
const LIMIT: u64 = 100_000_000;

/// Calls a function of the image and gives its result and its cycles.
fn call(machine: &mut Machine, function: &str, arguments: &[u32], stacked: &[u32]) -> (u32, u64) {
    let address =
        machine.image().symbol(function).unwrap_or_else(|| panic!("{function} is not in the image"));
    let sp = machine.cpu.r[13] - 8 * (stacked.len() as u32).div_ceil(2);
    let words: Vec<u8> = stacked.iter().flat_map(|word| word.to_le_bytes()).collect();
    assert!(machine.memory_mut().program(sp, &words));
    machine.cpu.r[13] = sp;
    let before = machine.usage().cycles;
    let stop = machine
        .call_function(address, arguments, before + LIMIT)
        .unwrap_or_else(|fault| panic!("{function}: {fault}"));
    assert_eq!(stop, Stop::Returned, "{function}");
    machine.cpu.r[13] = sp + 8 * (stacked.len() as u32).div_ceil(2);
    (machine.cpu.r[0], machine.usage().cycles - before)
}

/// The nRF52840's flash with its instruction cache on (Nordic, nRF52840 Product Specification 1.7, "CPU, electrical
/// specification": W_FLASHCACHE is 3): code comes from the cache, data does not.
const NRF52840: WaitStates = WaitStates { cycles: 3, line: 4, prefetch: false, cached_code: true };

/// P256-Cortex-M4 by Emil Lenngren, "Performance": thousands of cycles on an nRF52840 with its instruction cache on,
/// GCC with -O2.
#[test]
fn p256_on_an_m4() {
    if !require_target(Core::M4.target()) || !require_program("arm-none-eabi-gcc") {
        return;
    }
    let path = cargo::image("calibration", "p256", Core::M4.target(), "firmware", &["p256"]);
    let image = Image::parse(&fs::read(path).unwrap()).unwrap();
    let mut worst = 0f64;
    for (waits, name) in [(WaitStates::NONE, "no wait states"), (NRF52840, "nRF52840")] {
        worst = p256(&image, waits, name);
    }
    assert!(worst < Core::M4.tolerance().unwrap(), "off by {:.2} %", worst * 100.0);
}

/// Runs all operations with these wait states of flash; gives the largest relative error.
fn p256(image: &Image, waits: WaitStates, flash: &str) -> f64 {
    let mut machine = Machine::new(Core::M4, &Board::mps2(), image).unwrap();
    machine.memory_mut().region_mut(0).unwrap().wait_states = waits;
    let ram = 0x2000_0000;
    let [private, x, y, hash, r, s, secret] = [0, 1, 2, 3, 4, 5, 6].map(|slot| ram + 0x100 * slot);
    // Any number below the order will do: the running time does not depend on it.
    let number: Vec<u8> = (0..32).map(|at: u32| (at * 37 + 11) as u8 & 0x7f).collect();
    for place in [private, hash] {
        assert!(machine.memory_mut().program(place, &number));
    }
    let mut worst = 0f64;
    let mut check = |name: &str, published: f64, (result, cycles): (u32, u64)| {
        assert_eq!(result & 0xff, 1, "{name} failed");
        let error = cycles as f64 / published / 1000.0 - 1.0;
        let error_percent = error * 100.0;
        println!(
            "cortex-m4, {flash}, p256 {name}: published {published}k, simulated {cycles} ({error_percent:+.2} %)"
        );
        worst = worst.max(error.abs());
    };
    check("keygen", 327.0, call(&mut machine, "p256_keygen", &[x, y, private], &[]));
    check("sign", 375.0, call(&mut machine, "p256_sign", &[r, s, hash, 32], &[private, hash]));
    check("verify", 976.0, call(&mut machine, "p256_verify", &[x, y, hash, 32], &[r, s]));
    check(
        "shared secret",
        906.0,
        call(&mut machine, "p256_ecdh_calc_shared_secret", &[secret, private, x, y], &[]),
    );
    worst
}

/// The functions of the image `kernels`.
const KERNELS: [&str; 5] = ["lookup", "serial", "predict", "divide", "decode"];

/// rp2040js 1.4.1 counts the cycles of a Cortex-M0+ by itself. It takes the N of "PUSH 1 + N, POP with PC 3 + N" (M0+
/// TRM, table 3-1) without the LR and the PC, which cannot be: each is a transfer on the same 32-bit bus.
#[test]
fn kernels_on_an_m0plus_as_in_rp2040js() {
    let core = Core::M0Plus;
    let Some(package) = npm_package("rp2040js").filter(|_| require_target(core.target())) else {
        return;
    };
    let path = cargo::image("calibration", "kernels", core.target(), "firmware", &[]);
    let image = Image::parse(&fs::read(path).unwrap()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let rom = folder.path().join("rom.bin");
    let machine = Machine::new(core, &Board::microbit(), &image).unwrap();
    fs::write(&rom, machine.memory().bytes(0, 16 << 10).unwrap()).unwrap();
    let addresses = KERNELS.map(|name| format!("{name}={}", image.symbol(name).unwrap()));
    let script = bunraku_tests::workspace().join("tests/peers/thumb_rp2040js.mjs");
    let output = Command::new("node").arg(script).arg(package).arg(rom).args(addresses).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let theirs: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for name in KERNELS {
        let mut machine = Machine::new(core, &Board::microbit(), &image).unwrap();
        let (result, cycles) = call(&mut machine, name, &[], &[]);
        let instructions = machine.usage().instructions;
        let theirs = &theirs[name];
        let counted = theirs["cycles"].as_u64().unwrap();
        assert_eq!(theirs["result"], result, "{name}");
        assert_eq!(theirs["instructions"], instructions, "{name}");
        let linked = theirs["linked"].as_u64().unwrap();
        let percent = |counted: u64| (cycles as f64 / counted as f64 - 1.0) * 100.0;
        println!(
            "cortex-m0plus {name}: rp2040js {counted}, with its {linked} PUSH LR and POP PC as in the TRM {}, simulated \
             {cycles} ({:+.3} %, {:+.3} %)",
            counted + linked,
            percent(counted),
            percent(counted + linked)
        );
        assert_eq!(counted + linked, cycles, "{name}");
    }
}
