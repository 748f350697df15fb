//! What `bunraku profile` reports of a clip, core by core.

use super::elf::{Memory, Section};
use super::loaded::LoadedImage;
use super::measure::Measured;
use super::parts::Energy;
use crate::plot::flame::Node;
use anyhow::Result;
use serde::{Deserialize, Serialize};
use thumb_cycles::Core;

/// The clip, and how it was run: figures of two reports compare where these are equal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Subject {
    /// Bytes of the clip.
    pub clip_bytes: usize,
    /// Its frames.
    pub frames: u32,
    /// Its channels.
    pub channels: usize,
    /// What else its container says.
    #[serde(flatten)]
    pub container: Container,
    /// Wait states of the flash.
    pub wait_states: u32,
    /// Where ticks of a puppet were run instead of frames: the puppet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub puppet: Option<Ticks>,
}

/// What is particular to a container.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Container {
    /// A .qmd.
    Qmd {
        /// Channels of it that are floats (FDF).
        fixed_channels: u16,
        /// Bits of an index (b).
        index_bits: u8,
        /// Segments, each of which opens with a table.
        segments: u32,
        /// Whether the decoder was lent memory for its table.
        table: Table,
    },
    /// A .mclip.
    Mclip {
        /// The codec.
        codec: String,
        /// The entropy stage.
        entropy: String,
        /// Blocks, each of which has a checksum.
        blocks: u32,
        /// Bytes that the decoder is lent, in the static RAM.
        lent_bytes: usize,
    },
}

/// A puppet that a clip was played on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ticks {
    /// Ticks that the clip took.
    pub ticks: usize,
    /// Servos, each of which gets a goal every tick.
    pub servos: usize,
    /// Ticks a second.
    pub servo_hz: u16,
}

impl Subject {
    /// What was counted: frames, or ticks.
    pub fn unit(&self) -> &'static str {
        if self.puppet.is_some() { "tick" } else { "frame" }
    }

    /// What one of them has many of: channels, or servos.
    pub fn samples(&self) -> usize {
        self.puppet.as_ref().map_or(self.channels, |puppet| puppet.servos)
    }
}

/// Whether the decoder is lent memory for a converted table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Table {
    /// Four bytes an entry of RAM; a segment's table is converted once.
    Lent,
    /// None; every look-up converts a float.
    None,
}

/// What a clip costs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Name of the clip's file.
    pub clip: String,
    /// What was run.
    #[serde(flatten)]
    pub subject: Subject,
    /// Frames per second that shares and energy are for; ticks, where there is a puppet.
    pub rate_hz: f64,
    /// What it costs on each core.
    pub cores: Vec<CoreReport>,
    /// How fast the simulation was; the only figures that differ from run to run.
    pub simulation: Simulation,
}

/// How fast the simulator ran.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Simulation {
    /// Instructions that were executed, on all cores together.
    pub instructions: u64,
    /// Seconds that took.
    pub seconds: f64,
    /// The quotient.
    pub instructions_per_second: f64,
}

/// What a clip costs on one core; where there is a puppet, every "frame" is a tick.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CoreReport {
    /// The core, for instance `cortex-m4`.
    pub core: &'static str,
    /// How far cycles may be off, as a part of 1 (docs/CYCLES.md).
    pub tolerance: Option<f64>,
    /// Cycles of the cheapest frame.
    pub cycles_min: u64,
    /// Cycles of a frame on average.
    pub cycles_mean: f64,
    /// Cycles that 99 % of all frames do not exceed.
    pub cycles_p99: u64,
    /// Cycles of the most expensive frame.
    pub cycles_max: u64,
    /// Its number, from 0.
    pub worst_frame: usize,
    /// Cycles of a frame on average, by channels; of a tick, by servos.
    pub cycles_per_sample: f64,
    /// Cycles of checking the clip and making its decoder, before the first frame.
    pub cycles_open: u64,
    /// Deepest stack, with the decoder itself and all that calls it.
    pub stack_bytes: u32,
    /// Deepest stack of decoding a frame alone.
    pub frame_stack_bytes: u32,
    /// Flash that the image takes, clip included.
    pub flash_bytes: u64,
    /// The functions of the decoder in it.
    pub code_bytes: u64,
    /// Static RAM.
    pub ram_bytes: u64,
    /// Flash and RAM by section.
    pub sections: Vec<Section>,
    /// Functions, those with the most cycles in all frames first.
    pub functions: Vec<Function>,
    /// The clock that shares are for.
    pub clock_hz: f64,
    /// Part of a frame's time that decoding takes on average, of 1.
    pub frame_share_mean: f64,
    /// The same of the most expensive frame.
    pub frame_share_max: f64,
    /// What a part draws, where one was named.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<Energy>,
    /// Cycles of each frame, for plots.
    #[serde(skip)]
    pub frame_cycles: Vec<u64>,
    /// Cycles of functions and of what is inlined in them, for plots.
    #[serde(skip)]
    pub flame: Node,
}

/// A function's part of the frames' cycles.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Function {
    /// Its name.
    pub name: String,
    /// Its bytes.
    pub bytes: u32,
    /// Cycles in it but not in what it calls, on average over frames.
    pub self_cycles: f64,
    /// Part of all cycles, of 1.
    pub share: f64,
}

impl CoreReport {
    /// Sums up what was measured on `core` with an image whose frames have so many samples.
    ///
    /// # Errors
    /// A sentence where the image is no ELF file.
    pub fn new(
        core: Core,
        image: &LoadedImage,
        measured: Measured,
        samples: usize,
        clock_hz: f64,
        rate_hz: f64,
    ) -> Result<Self> {
        let memory = Memory::of(&image.elf)?.with(image.file_bytes(), image.lent_bytes);
        let frames = measured.frame_cycles;
        let mut sorted = frames.clone();
        sorted.sort_unstable();
        let total: u64 = sorted.iter().sum();
        let count = frames.len().max(1) as f64;
        let mean = total as f64 / count;
        let max = sorted.last().copied().unwrap_or(0);
        // Nearest rank: the smallest value that at least 99 % do not exceed.
        let p99 = sorted.get((sorted.len() * 99).div_ceil(100).saturating_sub(1)).copied().unwrap_or(0);
        let functions = (measured.functions.into_iter())
            .map(|function| Function {
                name: function.name,
                bytes: function.bytes,
                self_cycles: function.cycles as f64 / count,
                share: function.cycles as f64 / total.max(1) as f64,
            })
            .collect();
        Ok(Self {
            core: core.name(),
            tolerance: core.tolerance(),
            cycles_min: sorted.first().copied().unwrap_or(0),
            cycles_mean: mean,
            cycles_p99: p99,
            cycles_max: max,
            worst_frame: frames.iter().position(|&cycles| cycles == max).unwrap_or(0),
            cycles_per_sample: mean / samples as f64,
            cycles_open: measured.open_cycles,
            stack_bytes: measured.stack_bytes,
            frame_stack_bytes: measured.frame_stack_bytes,
            flash_bytes: memory.flash_bytes(),
            code_bytes: memory.code_bytes,
            ram_bytes: memory.ram_bytes(),
            sections: memory.sections,
            functions,
            clock_hz,
            frame_share_mean: mean * rate_hz / clock_hz,
            frame_share_max: max as f64 * rate_hz / clock_hz,
            energy: None,
            frame_cycles: frames,
            flame: measured.flame,
        })
    }
}

/// Most that the worst frame may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Cycles.
    Cycles(u64),
    /// A part of a frame's time, of 1.
    Share(f64),
}

impl std::str::FromStr for Budget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("\"{text}\" is no budget, expected cycles (2000) or a part of a frame's time (5%)");
        match text.strip_suffix('%') {
            Some(percent) => match percent.trim().parse::<f64>() {
                Ok(percent) if percent > 0.0 && percent.is_finite() => Ok(Self::Share(percent / 100.0)),
                _ => Err(wrong()),
            },
            None => text.parse().map(Self::Cycles).map_err(|_| wrong()),
        }
    }
}

impl Budget {
    /// Says by how much the worst frame is over, if it is. `unit` is [`Subject::unit`].
    pub fn exceeded(self, core: &CoreReport, unit: &str) -> Option<String> {
        let (name, worst, cycles) = (core.core, core.worst_frame, core.cycles_max);
        match self {
            Self::Cycles(most) if cycles > most => {
                Some(format!("{name}: {unit} {worst} takes {cycles} cycles, over the budget of {most}"))
            }
            Self::Share(most) if core.frame_share_max > most => Some(format!(
                "{name}: {unit} {worst} takes {cycles} cycles, {:.2} % of a {unit}'s time at {} MHz, over the budget of {} %",
                core.frame_share_max * 100.0,
                core.clock_hz / 1e6,
                most * 100.0
            )),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use thumb_cycles::SelfCycles;

    fn report(frame_cycles: Vec<u64>) -> CoreReport {
        let own = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        let measured = Measured {
            frame_cycles,
            functions: vec![SelfCycles { name: "large".to_owned(), bytes: 4, cycles: 400 }],
            ..Measured::default()
        };
        CoreReport::new(Core::M4, &LoadedImage::alone(own), measured, 10, 1e6, 100.0).unwrap()
    }

    #[test]
    fn figures_are_those_of_the_frames() {
        let core = report((1..=200).rev().collect());
        assert_eq!((core.cycles_min, core.cycles_p99, core.cycles_max, core.worst_frame), (1, 198, 200, 0));
        assert!((core.cycles_mean - 100.5).abs() < 1e-9);
        assert!((core.cycles_per_sample - 10.05).abs() < 1e-9);
        assert!((core.frame_share_max - 0.02).abs() < 1e-9);
        assert_eq!(core.functions[0].name, "large");
        assert!((core.functions[0].self_cycles - 2.0).abs() < 1e-9);
    }

    #[test]
    fn budgets_are_cycles_or_a_share() {
        let core = report(vec![100, 300, 200]);
        assert_eq!("300".parse::<Budget>().unwrap().exceeded(&core, "frame"), None);
        let over = "299".parse::<Budget>().unwrap().exceeded(&core, "frame").unwrap();
        assert!(over.contains("frame 1 takes 300 cycles"), "{over}");
        // 300 cycles at 1 MHz are 3 % of 1/100 s.
        assert_eq!("3%".parse::<Budget>().unwrap().exceeded(&core, "frame"), None);
        let over = "2.9%".parse::<Budget>().unwrap().exceeded(&core, "frame").unwrap();
        assert!(over.contains("3.00 %"), "{over}");
        for wrong in ["", "%", "-3", "0%", "5 per cent", "inf%"] {
            assert!(wrong.parse::<Budget>().is_err(), "{wrong}");
        }
    }
}
