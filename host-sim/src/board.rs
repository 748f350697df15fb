//! The boards that this workspace has firmware for, and their images with a clip and a joint map in them.

use crate::image::Image;
use crate::profile::elf::Memory;
use anyhow::{Result, anyhow, bail};
use firmware::map::{BusKind, PCA9685_HZ};
use puppet_file::{Map, to_bytes};
use serde::Serialize;
use servo_wire::pwm::PwmTiming;
use virtual_servos::hobby::PWM_PINS;

/// QEMU's name of the board `qemu-mps2`.
pub const QEMU_MACHINE: &str = "mps2-an386";

/// That board's clock in hertz (Arm AN386, "Clocks").
pub const QEMU_CLOCK_HZ: u32 = 25_000_000;

/// A board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Board {
    /// Its package, and its name in commands.
    pub name: &'static str,
    /// Its folder in the workspace.
    source: &'static str,
    /// Rust's target.
    target: &'static str,
    /// Bytes of its flash for the image and of its RAM, as in its memory.x.
    flash: u64,
    ram: u64,
    /// Whether a host can upload clips; all play at their own rate then.
    has_host: bool,
    /// Kinds of buses that it has, one of each.
    buses: &'static [BusKind],
}

/// What boards with hobby servos have.
const HOBBY: &[BusKind] = &[BusKind::Dynamixel, BusKind::Pca9685, BusKind::Pwm];

const KB: u64 = 1 << 10;
const MB: u64 = 1 << 20;

/// QEMU's mps2-an386, a Cortex-M4.
pub const QEMU_MPS2: Board = Board {
    name: "qemu-mps2",
    source: "firmware/boards/qemu-mps2",
    target: "thumbv7em-none-eabi",
    flash: 4 * MB,
    ram: 4 * MB,
    has_host: false,
    buses: &[BusKind::Dynamixel],
};

/// Raspberry Pi Pico.
pub const RP2040: Board = Board {
    name: "rp2040",
    source: "firmware/boards/rp2040",
    target: "thumbv6m-none-eabi",
    flash: MB,
    ram: 264 * KB,
    has_host: true,
    buses: HOBBY,
};

/// All.
pub const BOARDS: [Board; 5] = [
    QEMU_MPS2,
    RP2040,
    Board {
        name: "rp2350",
        source: "firmware/boards/rp2350",
        target: "thumbv8m.main-none-eabi",
        flash: MB,
        ram: 512 * KB,
        has_host: true,
        buses: HOBBY,
    },
    Board {
        name: "stm32f411",
        source: "firmware/boards/stm32f411",
        target: "thumbv7em-none-eabi",
        flash: 512 * KB,
        ram: 128 * KB,
        has_host: true,
        buses: &[BusKind::Dynamixel],
    },
    Board {
        name: "nrf52840",
        source: "firmware/boards/nrf52840",
        target: "thumbv7em-none-eabi",
        flash: 512 * KB,
        ram: 256 * KB,
        has_host: true,
        buses: &[BusKind::Dynamixel],
    },
];

impl Board {
    /// The board called `name`.
    pub fn named(name: &str) -> Option<&'static Self> {
        BOARDS.iter().find(|board| board.name == name)
    }

    /// Builds the image that plays `clip` (the bytes of a .qmd or .mclip) by `map`: an ELF file.
    ///
    /// `centihertz` is the rate to play at, in hundredths of a hertz, or 0 for the clip's own. Cargo's messages go to
    /// standard error.
    ///
    /// # Errors
    /// A sentence that says what is missing: the source, cargo, the target, or what cargo could not build; and where a rate is
    /// given to a board that plays clips at their own, or the puppet has a bus or a servo for which the board has no place.
    pub fn build(&self, clip: &[u8], map: &Map, centihertz: u16) -> Result<Vec<u8>> {
        if self.has_host && centihertz != 0 {
            bail!("this board plays clips at their own rate, and not at another one: leave --fps out");
        }
        self.has_buses_of(map)?;
        let image = Image {
            package: self.name,
            source: self.source,
            binary: self.name,
            features: "",
            targets: &[self.target],
            folder: "play",
            files: &[("BUNRAKU_CLIP", "clip", clip), ("BUNRAKU_MAP", "map.postcard", &to_bytes(map))],
            variables: &[("BUNRAKU_CENTIHERTZ", &centihertz.to_string()), ("DEFMT_LOG", "info")],
        };
        Ok(image.build()?.concat())
    }

    /// Whether all servos of a puppet find a place.
    ///
    /// # Errors
    /// A sentence about the first bus or servo that does not.
    fn has_buses_of(&self, map: &Map) -> Result<()> {
        for (index, bus) in map.buses().iter().enumerate() {
            let (kind, has) = (bus.kind.name(), self.buses.iter().map(|kind| kind.name()));
            if !self.buses.contains(&bus.kind) {
                bail!(
                    "this board has no bus of the kind \"{kind}\", only {}",
                    has.collect::<Vec<_>>().join(", ")
                );
            }
            if map.buses().iter().take(index).any(|other| other.kind == bus.kind) {
                bail!("the puppet has two buses of the kind \"{kind}\", and this board one");
            }
            if bus.kind == BusKind::Pca9685 && bus.rate() != PCA9685_HZ {
                bail!("this board's PCA9685 gives {PCA9685_HZ} pulses a second, and `baud` is {}", bus.baud);
            }
            if bus.kind != BusKind::Pwm {
                continue;
            }
            if PwmTiming::of(bus.baud).is_none() {
                bail!("this board gives 40 to 400 pulses a second on PWM pins, and `baud` is {}", bus.baud);
            }
            let joints = map.joints().iter().filter(|joint| usize::from(joint.bus) == index);
            if let Some(joint) =
                joints.max_by_key(|joint| joint.id).filter(|joint| usize::from(joint.id) >= PWM_PINS)
            {
                bail!(
                    "a servo has the id {} on \"pwm\", and this board has {PWM_PINS} PWM pins, 0 to {}",
                    joint.id,
                    PWM_PINS - 1
                );
            }
        }
        Ok(())
    }

    /// What an image for this board takes.
    ///
    /// # Errors
    /// Where that is no ELF file.
    pub fn size(&self, elf: &[u8]) -> Result<Size> {
        let memory = Memory::of(elf)?;
        let bytes = |flash: bool, ram: bool| {
            let sections = memory.sections.iter();
            sections
                .filter(move |section| (section.flash, section.ram) == (flash, ram))
                .map(|section| section.bytes)
        };
        let [text, data, bss] =
            [(true, false), (true, true), (false, true)].map(|kind| bytes(kind.0, kind.1).sum());
        Ok(Size {
            board: self.name,
            text,
            data,
            bss,
            flash_share: (text + data) as f64 / self.flash as f64,
            ram_share: (data + bss) as f64 / self.ram as f64,
        })
    }
}

/// Bytes of an image. The stack takes what is left of the RAM.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Size {
    /// The board.
    pub board: &'static str,
    /// Code and constants, the clip among them: flash.
    pub text: u64,
    /// Variables with a value to begin with: flash and RAM.
    pub data: u64,
    /// Other variables: RAM.
    pub bss: u64,
    /// Part of the board's flash.
    pub flash_share: f64,
    /// Part of the board's RAM.
    pub ram_share: f64,
}

/// What images may take: bytes of flash and RAM, by board.
#[derive(Clone, Debug)]
pub struct Budget(toml::Table);

impl Budget {
    /// From TOML: a table a board, with the keys `flash` and `ram`.
    ///
    /// # Errors
    /// A sentence that names the line.
    pub fn parse(text: &str) -> Result<Self> {
        Ok(Self(text.parse()?))
    }

    /// What an image takes beyond its budget, as sentences.
    ///
    /// # Errors
    /// Where there is no budget for the board.
    pub fn exceeded(&self, size: &Size) -> Result<Vec<String>> {
        let budget = self.0.get(size.board).and_then(toml::Value::as_table);
        let Some(budget) = budget else { bail!("the budget has no table [{}]", size.board) };
        let mut complaints = Vec::new();
        for (key, found) in [("flash", size.text + size.data), ("ram", size.data + size.bss)] {
            let most = budget.get(key).and_then(toml::Value::as_integer);
            let most = most.and_then(|most| u64::try_from(most).ok());
            let most = most.ok_or_else(|| anyhow!("[{}] has no bytes in the key \"{key}\"", size.board))?;
            if found > most {
                complaints
                    .push(format!("{} takes {found} bytes of {key}, expected at most {most}", size.board));
            }
        }
        Ok(complaints)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_held_against_flash_and_ram() {
        let size = Size { board: "rp2040", text: 900, data: 100, bss: 50, flash_share: 0.0, ram_share: 0.0 };
        let exceeded = |text: &str| Budget::parse(text).unwrap().exceeded(&size);
        assert_eq!(exceeded("[rp2040]\nflash = 1000\nram = 150").unwrap(), Vec::<String>::new());
        let complaints = exceeded("[rp2040]\nflash = 999\nram = 149").unwrap();
        assert_eq!(complaints[0], "rp2040 takes 1000 bytes of flash, expected at most 999");
        assert_eq!(complaints[1], "rp2040 takes 150 bytes of ram, expected at most 149");
        assert!(exceeded("[rp2040]\nflash = 1000").unwrap_err().to_string().contains("ram"));
        assert!(exceeded("[rp2350]").unwrap_err().to_string().contains("[rp2040]"));
    }

    #[test]
    fn a_bus_or_a_servo_that_finds_no_place_is_named() {
        let puppet = |buses: &[(&str, u32)], id: u8| {
            let mut text = "servo_hz = 50\n".to_owned();
            for (index, (kind, baud)) in buses.iter().enumerate() {
                text += &format!("[[bus]]\nname = '{index}'\nkind = '{kind}'\nbaud = {baud}\n");
            }
            for index in 0..buses.len() {
                text += &format!(
                    "[[joint]]\nname = '{index}'\nchannel = 'head.ry'\nbus = '{index}'\nid = {id}\nrange = [-1, 1]\n\
                     max_speed = 100\n"
                );
            }
            let puppet = puppet_file::Puppet::parse(std::path::Path::new("puppet.toml"), text).unwrap();
            puppet.map(&mocap::sample::clip().skeleton).unwrap()
        };
        let refused = |board: &Board, buses: &[(&str, u32)], id| {
            board.has_buses_of(&puppet(buses, id)).map_err(|error| error.to_string())
        };
        let all = [("pwm", 50), ("dynamixel", 57_600), ("pca9685", 50)];
        assert_eq!(refused(&RP2040, &all, 7), Ok(()));
        assert_eq!(
            refused(&QEMU_MPS2, &all, 7).unwrap_err(),
            "this board has no bus of the kind \"pwm\", only dynamixel"
        );
        let sts = refused(&RP2040, &[("sts", 1_000_000)], 1).unwrap_err();
        assert!(sts.ends_with("\"sts\", only dynamixel, pca9685, pwm"), "{sts}");
        let pins = refused(&RP2040, &all, 8).unwrap_err();
        assert_eq!(pins, "a servo has the id 8 on \"pwm\", and this board has 8 PWM pins, 0 to 7");
        assert!(refused(&RP2040, &[("pwm", 50), ("pwm", 50)], 1).unwrap_err().contains("two buses"));
        assert!(refused(&RP2040, &[("pwm", 500)], 1).unwrap_err().contains("`baud` is 500"));
        assert!(refused(&RP2040, &[("pca9685", 60)], 1).unwrap_err().contains("`baud` is 60"));
    }

    #[test]
    fn what_memory_a_board_has_is_what_its_linker_script_says() {
        for board in BOARDS {
            let path = format!("{}/../{}/memory.x", env!("CARGO_MANIFEST_DIR"), board.source);
            let script = std::fs::read_to_string(&path).unwrap();
            for (name, bytes) in [("FLASH", board.flash), ("RAM", board.ram)] {
                let line =
                    script.lines().find(|line| line.trim_start().starts_with(&format!("{name} :"))).unwrap();
                let lengths = [format!("LENGTH = {}K", bytes / KB), format!("LENGTH = {}M", bytes / MB)];
                assert!(lengths.iter().any(|length| line.contains(length)), "{path}: {line}");
            }
        }
    }
}
