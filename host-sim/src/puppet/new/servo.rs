//! What a usual servo of each kind can do.

use firmware::map::BusKind;
use puppet_file::Units;

/// A servo in position mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// What it speaks.
    pub kind: BusKind,
    /// The lowest goal that it takes.
    pub lowest: i32,
    /// The highest goal that it takes.
    pub highest: i32,
    /// Goals in a degree.
    pub goals_per_degree: f64,
    /// Degrees a second without load.
    pub speed: f64,
    /// Bits a second on the bus; of hobby servos pulses a second.
    pub baud: u32,
    /// The servo whose speed that is.
    pub model: &'static str,
}

impl Servo {
    /// Sources: e-Manual, "XM430-W350" (46 rpm at 12 V) and "AX-12A" (59 rpm at 12 V); Feetech's data sheets of the
    /// STS3215 (60° in 0.222 s at 7.4 V) and SCS15 (60° in 0.18 s at 6 V); hobby servos of the size of an MG996R need
    /// 0.17 s for 60° at 4.8 V. Rates are those from the factory, but for Dynamixel X: 57600 baud are few for many servos.
    pub fn of(kind: BusKind) -> Self {
        let (speed, baud, model) = match kind {
            BusKind::Dynamixel => (276.0, 1_000_000, "XM430-W350"),
            BusKind::Dynamixel1 => (354.0, 1_000_000, "AX-12A"),
            BusKind::Sts => (270.0, 1_000_000, "STS3215"),
            BusKind::Scs => (333.0, 1_000_000, "SCS15"),
            BusKind::Blender => (352.0, 115_200, "MG996R"),
            BusKind::Pwm | BusKind::Pca9685 => (352.0, 50, "MG996R"),
        };
        let Units { lowest, highest, per_degree: goals_per_degree } = Units::of(kind, None);
        Self { kind, lowest, highest, goals_per_degree, speed, baud, model }
    }

    /// The goal in the middle.
    pub const fn middle(&self) -> i32 {
        (self.lowest + self.highest + 1) / 2
    }

    /// How far it turns, in degrees.
    pub fn width(&self) -> f64 {
        f64::from(self.highest - self.lowest) / self.goals_per_degree
    }
}
