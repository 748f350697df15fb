//! Runs a bare image on the simulator, frame by frame.

use super::flame;
use super::loaded::LoadedImage;
use crate::plot::flame::Node;
use anyhow::{Context, Result, anyhow, bail};
use std::time::{Duration, Instant};
use thumb_cycles::{Board, Core, Image, Machine, Region, SelfCycles, Stop};

/// Cycles that one call of the image may take: more than any clip's table takes to convert.
pub(super) const LIMIT: u64 = 2_000_000_000;

/// Where an image's memory begins: the memory.x of the board qemu-mps2.
const FLASH: u32 = 0;
const RAM: u32 = 0x2000_0000;
/// Bytes of each. More than a microcontroller has, so that any clip can be tried.
const BYTES: usize = 4 << 20;

/// What running an image has shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Cycles of every frame, in order.
    pub frame_cycles: Vec<u64>,
    /// Cycles of what comes before the first frame.
    pub open_cycles: u64,
    /// Deepest stack of the whole run, below its top.
    pub stack_bytes: u32,
    /// Deepest stack of a frame, below where its function was called.
    pub frame_stack_bytes: u32,
    /// Own cycles, all frames together, of the functions that frames are spent in.
    pub functions: Vec<SelfCycles>,
    /// The same by calls.
    pub flame: Node,
    /// Instructions executed in frames.
    pub instructions: u64,
    /// How long this machine took to simulate them.
    pub simulated: Duration,
}

/// An image that decodes frames, stopped before the first one.
///
/// It has the functions `open`, which is called once, and `decode_frame`, which takes a pointer and returns a pointer
/// to a frame and its length, or 0; and `failed`, where it ends up otherwise.
pub struct Runner {
    machine: Machine,
    decode_frame: u32,
    /// What `decode_frame` is given.
    state: u32,
    measured: Measured,
    stack_top: u32,
}

impl Runner {
    /// Loads the image and runs it up to its first frame.
    ///
    /// # Errors
    /// A sentence where the image is not of this kind, stops with a fault, or refuses its clip.
    pub fn new(core: Core, loaded: &LoadedImage, wait_states: u32) -> Result<Self> {
        let (image, mut machine) = start(core, loaded, wait_states)?;
        let symbol = |name: &str| {
            image
                .symbol(name)
                .map(|address| address & !1)
                .ok_or_else(|| anyhow!("the image has no function {name}"))
        };
        let (open, decode_frame) = (symbol("open")?, symbol("decode_frame")?);
        let stack_top = machine.cpu.r[13];
        // An image that cannot fail has no `failed`.
        for address in [Some(open), Some(decode_frame), image.symbol("failed")].into_iter().flatten() {
            machine.set_breakpoint(address);
        }
        run_to(&mut machine, open).context("before its clip is opened")?;
        let before = machine.usage().cycles;
        let back = machine.cpu.r[14] & !1;
        machine.set_breakpoint(back);
        run_to(&mut machine, back).context("while its clip is opened")?;
        let open_cycles = machine.usage().cycles - before;
        machine.clear_breakpoint(back);
        run_to(&mut machine, decode_frame).context("before its first frame")?;
        for address in [open, decode_frame] {
            machine.clear_breakpoint(address);
        }
        let measured = Measured { open_cycles, stack_bytes: machine.usage().stack, ..Measured::default() };
        let state = machine.cpu.r[0];
        machine.reset_profile();
        machine.reset_stack_mark();
        Ok(Self { machine, decode_frame, state, measured, stack_top })
    }

    /// Decodes a frame: its bytes in the image's memory, elements of `element` bytes; `None` after the last one.
    ///
    /// # Errors
    /// A fault of the image, or a frame that is not in memory.
    pub fn next_frame(&mut self, element: usize) -> Result<Option<&[u8]>> {
        let machine = &mut self.machine;
        let before = machine.usage();
        let number = self.measured.frame_cycles.len();
        let started = Instant::now();
        let stop = machine.call_function(self.decode_frame, &[self.state], before.cycles + LIMIT);
        self.measured.simulated += started.elapsed();
        self.measured.instructions += machine.usage().instructions - before.instructions;
        match stop {
            Ok(Stop::Returned) => {}
            Ok(Stop::Breakpoint(_)) => bail!("the image failed in frame {number}"),
            Ok(Stop::Limit) => bail!("frame {number} takes more than {LIMIT} cycles"),
            Ok(stop) => bail!("the image stopped in frame {number}: {stop:?}"),
            Err(fault) => return Err(anyhow!(fault).context(format!("frame {number}"))),
        }
        let (pointer, len) = (machine.cpu.r[0], machine.cpu.r[1] as usize);
        if pointer == 0 {
            return Ok(None);
        }
        self.measured.frame_cycles.push(machine.usage().cycles - before.cycles);
        let bytes = machine.memory().bytes(pointer, len.saturating_mul(element));
        let bytes =
            bytes.with_context(|| format!("frame {number} is at {pointer:#010x}, which is no memory"))?;
        Ok(Some(bytes))
    }

    /// Ends, with all that was seen.
    pub fn finish(mut self) -> Measured {
        let usage = self.machine.usage();
        let depth = self.stack_top - self.machine.cpu.r[13];
        let paths = self.machine.call_paths();
        // Frames are called by the host, on the first path.
        let frame = paths.iter().position(|path| path.parent == Some(0)).unwrap_or(0);
        let mut measured = self.measured;
        measured.flame = flame::tree(&paths, frame);
        measured.functions = self.machine.self_cycles();
        measured.frame_stack_bytes = usage.stack;
        measured.stack_bytes = measured.stack_bytes.max(depth + usage.stack);
        measured
    }
}

/// The image on a core, after reset, with memory like that of the board qemu-mps2 and its files in flash.
pub(super) fn start(core: Core, loaded: &LoadedImage, wait_states: u32) -> Result<(Image, Machine)> {
    let image = Image::parse(&loaded.elf).map_err(|error| anyhow!(error))?;
    let mut flash = Region::new("flash", FLASH, BYTES, false);
    flash.wait_states.cycles = wait_states;
    for (address, bytes) in &loaded.files {
        let from = (address - FLASH) as usize;
        let place = flash.data.get_mut(from..from.saturating_add(bytes.len()));
        place.with_context(|| format!("{BYTES} bytes of flash are too few"))?.copy_from_slice(bytes);
    }
    let regions = vec![flash, Region::new("RAM", RAM, BYTES, true)];
    let board = Board { name: "profile", regions, ..Board::bare() };
    let machine = Machine::new(core, &board, &image).map_err(|error| anyhow!(error))?;
    Ok((image, machine))
}

fn run_to(machine: &mut Machine, address: u32) -> Result<()> {
    let limit = machine.usage().cycles + LIMIT;
    match machine.run_until(limit) {
        Ok(Stop::Breakpoint(at)) if at == address => Ok(()),
        Ok(Stop::Breakpoint(_)) => bail!("the image refused its clip"),
        Ok(stop) => bail!("the image stopped: {stop:?}"),
        Err(fault) => Err(anyhow!(fault)),
    }
}

/// What an image is to give, frame by frame, as its memory holds it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Expected {
    /// Bytes of an element: `decode_frame` returns a number of these.
    pub element: usize,
    /// The bytes of each frame.
    pub frames: Vec<Vec<u8>>,
}

/// Runs an image and compares every frame with the one that is expected. `progress` is told after each.
///
/// # Errors
/// As [`Runner`]; also where a frame is another.
pub fn frames(
    core: Core,
    image: &LoadedImage,
    wait_states: u32,
    expected: &Expected,
    progress: &mut dyn FnMut(),
) -> Result<Measured> {
    let mut runner = Runner::new(core, image, wait_states)?;
    for (number, frame) in expected.frames.iter().enumerate() {
        match runner.next_frame(expected.element)? {
            Some(found) if found == frame => progress(),
            Some(_) => bail!("frame {number} differs between {} and this machine", core.name()),
            None => bail!("the image of {} ended after {number} frames", core.name()),
        }
    }
    if runner.next_frame(expected.element)?.is_some() {
        bail!("the image of {} gave more than {} frames", core.name(), expected.frames.len());
    }
    Ok(runner.finish())
}
