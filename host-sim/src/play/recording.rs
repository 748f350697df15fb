//! What servos were told, and the log of it.

use std::io;

/// A goal position that a servo took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// The tick's time in microseconds: its number times the tick's period, rounded down.
    pub time_us: u64,
    /// The number of its bus in the puppet.
    pub bus: u8,
    /// The servo.
    pub id: u8,
    /// The goal position.
    pub position: i32,
}

/// What the servos were told, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recording {
    /// Ticks played.
    pub ticks: u32,
    /// Every goal of every servo.
    pub goals: Vec<Taken>,
    /// Where each servo was as each tick's goals came, in the order of the joint map.
    pub present: Vec<Vec<i32>>,
    /// Instructions that servos refused.
    pub refused: u32,
}

impl Recording {
    /// Writes the log: a header, then time in seconds, bus, servo id and goal position, a line a goal. `buses` are their names.
    ///
    /// # Errors
    /// Those of `file`.
    pub fn write_csv(&self, file: &mut dyn io::Write, buses: &[String]) -> io::Result<()> {
        writeln!(file, "time_s,bus,servo,goal_position")?;
        for Taken { time_us, bus, id, position } in &self.goals {
            let bus = buses.get(usize::from(*bus)).map_or("", String::as_str);
            writeln!(file, "{},{bus},{id},{position}", seconds(*time_us))?;
        }
        Ok(())
    }
}

/// Microseconds as seconds, with all six decimals.
pub fn seconds(micros: u64) -> String {
    format!("{}.{:06}", micros / 1_000_000, micros % 1_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_six_decimals() {
        assert_eq!([0, 16_666, 61_000_001].map(seconds), ["0.000000", "0.016666", "61.000001"]);
    }
}
