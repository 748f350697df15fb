//! Microcontrollers, and what their datasheets say they draw.
//!
//! Typical figures at 25 °C, of the whole chip with its peripherals off. `run_ma` is while code runs from flash at
//! `clock_hz`; `sleep_ma` is between frames, in a state that keeps RAM and wakes by a timer.

use thumb_cycles::Core;

/// A microcontroller and its supply currents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Its name on the command line.
    pub name: &'static str,
    /// Its core.
    pub core: Core,
    /// The clock of `run_ma`.
    pub clock_hz: f64,
    /// Supply voltage.
    pub volts: f64,
    /// Current while code runs, in mA.
    pub run_ma: f64,
    /// Current between frames, in mA.
    pub sleep_ma: f64,
    /// Where the figures come from, and under which conditions they hold.
    pub source: &'static str,
}

/// The parts that `--part` knows.
pub const PARTS: [Part; 4] = [
    Part {
        name: "nrf52840",
        core: Core::M4,
        clock_hz: 64e6,
        volts: 3.0,
        run_ma: 3.3,
        sleep_ma: 0.003_16,
        source: "nRF52840 Product Specification v1.11, Current consumption: ICPU0 (CoreMark from flash, cache, HFXO, \
                 DC/DC) and ION_RAMON_RTC (System ON, 256 kB RAM kept, wake on RTC)",
    },
    Part {
        name: "stm32f411",
        core: Core::M4,
        clock_hz: 100e6,
        volts: 3.3,
        run_ma: 10.0,
        sleep_ma: 0.042,
        source: "STM32F411xC/xE datasheet DS10314, Features: Run 100 µA/MHz (peripherals off), Stop 42 µA (flash in \
                 Stop mode, fast wake-up); waking takes longer than a frame's decoding and is not counted",
    },
    Part {
        name: "samd51",
        core: Core::M4,
        clock_hz: 120e6,
        volts: 3.3,
        run_ma: 7.8,
        sleep_ma: 1.32,
        source: "SAM D5x/E5x datasheet DS60001507, Power Consumption: Active, CoreMark, buck, FDPLL 120 MHz: \
                 65 µA/MHz; Idle: 11 µA/MHz",
    },
    Part {
        name: "rp2040",
        core: Core::M0Plus,
        clock_hz: 48e6,
        volts: 3.3,
        run_ma: 10.6,
        sleep_ma: 0.39,
        source: "RP2040 datasheet, Power Consumption, typical averages: BOOTSEL mode, active, 48 MHz: 9.4 mA DVDD and \
                 1.2 mA IOVDD, both through the chip's linear regulator or pins; SLEEP: 0.39 mA DVDD. The datasheet \
                 has no table at 125 MHz",
    },
];

impl Part {
    /// The part called `name`.
    pub fn named(name: &str) -> Option<&'static Self> {
        PARTS.iter().find(|part| part.name == name)
    }

    /// What decoding costs where a frame takes `cycles` and there are `rate` frames a second.
    ///
    /// Only the decoder is counted: what else the firmware does, and the servos, come on top.
    pub fn energy(&self, cycles: f64, rate: f64, battery_mah: f64) -> Energy {
        let busy = cycles / self.clock_hz;
        let share = (busy * rate).min(1.0);
        let mean_ma = self.run_ma * share + self.sleep_ma * (1.0 - share);
        Energy {
            part: self.name,
            clock_hz: self.clock_hz,
            volts: self.volts,
            run_ma: self.run_ma,
            sleep_ma: self.sleep_ma,
            microjoules_per_frame: busy * self.run_ma * self.volts * 1e3,
            mean_microamps: mean_ma * 1e3,
            battery_mah,
            battery_hours: battery_mah / mean_ma,
            source: self.source,
        }
    }
}

/// What a clip draws from a part's supply.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Energy {
    /// The part.
    pub part: &'static str,
    /// Its clock.
    pub clock_hz: f64,
    /// Its supply voltage.
    pub volts: f64,
    /// Its current while it decodes, in mA.
    pub run_ma: f64,
    /// Its current between frames, in mA.
    pub sleep_ma: f64,
    /// Energy that decoding a frame takes on average, in µJ.
    pub microjoules_per_frame: f64,
    /// Current averaged over decoding and sleeping, in µA.
    pub mean_microamps: f64,
    /// The battery, in mAh.
    pub battery_mah: f64,
    /// How long it lasts at the mean current.
    pub battery_hours: f64,
    /// Where the currents come from.
    pub source: &'static str,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_is_that_of_the_datasheet_at_its_ends() {
        let part = Part::named("nrf52840").unwrap();
        // Never asleep: 3.3 mA at 3 V for 1/100 s.
        let busy = part.energy(640_000.0, 100.0, 330.0);
        assert!((busy.mean_microamps - 3300.0).abs() < 1e-6);
        assert!((busy.microjoules_per_frame - 99.0).abs() < 1e-6);
        assert!((busy.battery_hours - 100.0).abs() < 1e-6);
        let idle = part.energy(0.0, 100.0, 330.0);
        assert!((idle.mean_microamps - 3.16).abs() < 1e-6);
        // Half the time: half of both.
        let half = part.energy(320_000.0, 100.0, 330.0);
        assert!((half.mean_microamps - 1651.58).abs() < 1e-6);
    }

    #[test]
    fn every_part_says_where_its_figures_come_from() {
        for part in PARTS {
            assert!(
                part.source.contains("atasheet") || part.source.contains("Specification"),
                "{}",
                part.name
            );
            assert!(part.run_ma > part.sleep_ma && part.sleep_ma > 0.0, "{}", part.name);
        }
    }
}
