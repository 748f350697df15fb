//! How long a wearable is awake: a whole image that sleeps between its ticks, run on the simulator.
//!
//! Counted is all that its core does from one tick's outputs to the next one's: storing levels, going to sleep, waking, the
//! timer's interrupt, decoding. The levels of every tick are compared with those of the same library on this machine.

use super::measure;
use crate::clip::Clip;
use anyhow::{Context, Result, anyhow, bail};
use firmware::clock::{Clock, MAX_TICK_HZ, Speed};
use firmware::wearable::Wearable;
use puppet_file::{Map, to_bytes};
use thumb_cycles::{Core, Stop};

/// Most that SysTick counts to.
const MOST_RELOAD: u32 = 1 << 24;

/// What a wearable was seen to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WearableCost {
    /// Cycles awake of each tick, in order.
    pub awake: Vec<u64>,
    /// Cycles from the first tick's outputs to the last one's, asleep or not.
    pub cycles: u64,
    /// Bytes of flash and of static RAM of the image, with the clip.
    pub flash_bytes: u64,
    /// Static RAM.
    pub ram_bytes: u64,
    /// Deepest stack in bytes.
    pub stack_bytes: u32,
}

impl WearableCost {
    /// Part of the time in which it was awake, of 1.
    pub fn share(&self) -> f64 {
        self.awake.iter().sum::<u64>() as f64 / self.cycles as f64
    }

    /// Cycles awake a tick, on average.
    pub fn mean(&self) -> f64 {
        self.awake.iter().sum::<u64>() as f64 / self.awake.len() as f64
    }

    /// The most that a tick took.
    pub fn worst(&self) -> u64 {
        self.awake.iter().copied().max().unwrap_or(0)
    }
}

/// Wears `clip`, whose bytes are `bytes`, once and to its first frame again, at `output_hz` ticks a second of a Cortex-M4 at
/// `clock_hz` whose flash has `wait_states`.
///
/// # Errors
/// Where clip and map do not fit together, the image cannot be built or stops with a fault, or its levels differ from ours.
pub fn measure_wearable(
    clip: &Clip<'_>,
    bytes: &[u8],
    map: &Map,
    output_hz: u16,
    clock_hz: u32,
    wait_states: u32,
) -> Result<WearableCost> {
    if output_hz == 0 || output_hz > MAX_TICK_HZ || clock_hz / u32::from(output_hz) > MOST_RELOAD {
        bail!("{output_hz} ticks a second are not what SysTick counts at {} MHz", clock_hz / 1_000_000);
    }
    let expected = levels(clip, map, output_hz)?;
    let core = Core::M4;
    let loaded = super::wearable_image(bytes, &to_bytes(map), core.target(), output_hz, clock_hz)?;
    let (image, mut machine) = measure::start(core, &loaded, wait_states)?;
    let present = image.symbol("present").context("the image has no function present")? & !1;
    let failed = image.symbol("failed").map(|address| address & !1);
    for address in [Some(present), failed].into_iter().flatten() {
        machine.set_breakpoint(address);
    }
    let mut cost =
        WearableCost { awake: Vec::new(), cycles: 0, flash_bytes: 0, ram_bytes: 0, stack_bytes: 0 };
    let mut before = None;
    for (tick, expected) in expected.iter().enumerate() {
        // The first tick comes after the clip was opened.
        let limit = machine.usage().cycles + measure::LIMIT;
        match machine.run_until(limit) {
            Ok(Stop::Breakpoint(address)) if address == present => {}
            Ok(stop) => bail!("the image stopped in tick {tick}: {stop:?}"),
            Err(fault) => return Err(anyhow!(fault).context(format!("tick {tick}"))),
        }
        let (pointer, len) = (machine.cpu.r[0], machine.cpu.r[1] as usize);
        let bytes = machine.memory().bytes(pointer, 4 * len).context("levels that are in no memory")?;
        let levels = bytes
            .chunks_exact(4)
            .map(|word| word.iter().rev().fold(0, |word, &byte| word << 8 | i32::from(byte)));
        if !levels.eq(expected.iter().copied()) {
            bail!("the levels of tick {tick} are not those of this machine");
        }
        let usage = machine.usage();
        let (cycles, awake) = (usage.cycles, usage.cycles - usage.asleep);
        if let Some((first, last)) = before {
            cost.awake.push(awake - last);
            cost.cycles = cycles - first;
        }
        before = Some((before.map_or(cycles, |(first, _)| first), awake));
    }
    let memory = super::elf::Memory::of(&loaded.elf)?.with(loaded.file_bytes(), loaded.lent_bytes);
    (cost.flash_bytes, cost.ram_bytes) = (memory.flash_bytes(), memory.ram_bytes());
    cost.stack_bytes = machine.usage().stack;
    Ok(cost)
}

/// The levels of every tick until the clip has begun again.
fn levels(clip: &Clip<'_>, map: &Map, output_hz: u16) -> Result<Vec<Vec<i32>>> {
    clip.decode(|decoder| {
        let mut clock = Clock::new(decoder.rate_centihertz(), output_hz);
        let frames = decoder.frames();
        let mut wearable = Wearable::new(decoder, map, output_hz)?;
        let (mut levels, mut passed) = (Vec::new(), 0);
        while passed <= frames {
            levels.push(wearable.tick()?.to_vec());
            clock.tick(Speed::NORMAL);
            while clock.frame_passed() {
                passed += 1;
            }
        }
        // Once more from the first frame on.
        levels.push(wearable.tick()?.to_vec());
        Ok(levels)
    })
}
