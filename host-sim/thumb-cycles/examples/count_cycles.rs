//! Counts the cycles of a function on every core that can run it.
//!
//!     cargo run --example count_cycles                                the function below
//!     cargo run --example count_cycles -- firmware.elf decode_frame   a function of an ELF file, called without arguments

use std::error::Error;
use thumb_cycles::{Board, Core, Image, Machine, Region, Stop};

/// More cycles than a function is expected to take.
const LIMIT: u64 = 1_000_000_000;

/// Where the embedded function is.
const SUM: u32 = 0x100;

/// Adds up the numbers from 1 to 100.
const CODE: &[u16] = &[
    0x2064, //       movs r0, #100
    0x2100, //       movs r1, #0
    0x1809, // next: adds r1, r1, r0
    0x3801, //       subs r0, #1
    0xd1fc, //       bne  next
    0x4608, //       mov  r0, r1
    0x4770, //       bx   lr
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (image, function) = match (arguments.next(), arguments.next()) {
        (Some(path), Some(name)) => {
            let image = Image::parse(&std::fs::read(&path).map_err(|error| format!("{path}: {error}"))?)?;
            let address = image
                .symbol(&name)
                .ok_or_else(|| format!("{path} has no function {name}: see `nm -C {path}`"))?;
            (image, address)
        }
        (None, None) => {
            let vectors = [0x1000, 0x2000, SUM as u16 | 1, 0];
            (Image::from_halfwords(&[(0, &vectors), (SUM, CODE)]), SUM)
        }
        _ => return Err("give an ELF file and the name of a function in it, or nothing".into()),
    };
    // Flash at 0 and RAM at 0x2000_0000, as on many boards; other memory maps are other regions.
    let board = Board {
        name: "flash at 0, RAM at 0x20000000",
        regions: vec![
            Region::new("flash", 0, 4 << 20, false),
            Region::new("RAM", 0x2000_0000, 4 << 20, true),
        ],
        ..Board::bare()
    };
    for core in Core::ALL {
        let mut machine = Machine::new(core, &board, &image)?;
        match machine.call_function(function, &[], LIMIT) {
            Ok(Stop::Returned) => {
                let usage = machine.usage();
                println!(
                    "{}: {} cycles, {} instructions, {} bytes of stack, r0 = {}",
                    core.name(),
                    usage.cycles,
                    usage.instructions,
                    usage.stack,
                    machine.cpu.r[0]
                );
                println!("    {}", core.evidence());
            }
            Ok(stop) => println!("{}: stopped: {stop:?}", core.name()),
            Err(fault) => println!("{}: {}", core.name(), fault.cause),
        }
    }
    Ok(())
}
