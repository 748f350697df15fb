//! The shaft: how it moves towards its goal.
//!
//! An ideal servo without load: it follows its profile exactly. Time runs in steps of 1 ms, so that the result does
//! not depend on how often one asks.

/// Seconds in a step.
const STEP: f64 = 0.001;

/// What the motor is told to do. Velocities in positions per second, accelerations in positions per second squared;
/// an infinite acceleration is `f64::INFINITY`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Drive {
    /// Torque off.
    Free,
    /// Move to `goal` no faster than `speed`.
    Position { goal: f64, speed: f64, acceleration: f64, profile: Profile },
    /// Turn at `speed`.
    Velocity { speed: f64, acceleration: f64 },
}

/// Kind of profile; the values are those of Moving Status, bits 4 and 5.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Profile {
    Step = 0x00,
    Rectangular = 0x10,
    Triangular = 0x20,
    Trapezoidal = 0x30,
}

/// Position and velocity of the shaft.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    pub position: f64,
    pub velocity: f64,
    pub drive: Drive,
}

impl Motion {
    pub fn new(position: f64) -> Self {
        Self { position, velocity: 0.0, drive: Drive::Free }
    }

    /// Whether another step would change anything.
    pub fn at_rest(&self) -> bool {
        match self.drive {
            Drive::Free => true,
            Drive::Position { .. } => self.arrived(),
            Drive::Velocity { speed, .. } => speed == 0.0 && self.velocity == 0.0,
        }
    }

    /// Whether the shaft stands at its goal.
    pub fn arrived(&self) -> bool {
        matches!(self.drive, Drive::Position { goal, .. } if goal == self.position && self.velocity == 0.0)
    }

    /// Sets off for `goal`; which kind of profile that is follows from the distance.
    pub fn go_to(&mut self, goal: f64, speed: f64, acceleration: f64, step: bool) {
        let distance = (goal - self.position).abs();
        let profile = match (step, acceleration.is_finite()) {
            (true, _) => Profile::Step,
            (false, false) => Profile::Rectangular,
            (false, true) if speed * speed / acceleration > distance => Profile::Triangular,
            (false, true) => Profile::Trapezoidal,
        };
        self.drive = Drive::Position { goal, speed, acceleration, profile };
    }

    /// Torque off: the shaft stops at once (there is no inertia) and holds nothing.
    pub fn release(&mut self) {
        self.velocity = 0.0;
        self.drive = Drive::Free;
    }

    /// Stands for 1 ms, whatever the motor does.
    pub const fn stand(&mut self) {
        self.velocity = 0.0;
    }

    /// Moves for 1 ms.
    pub fn step(&mut self) {
        match self.drive {
            Drive::Free => {}
            Drive::Position { goal, speed, acceleration, .. } => self.step_to(goal, speed, acceleration),
            Drive::Velocity { speed, acceleration } => {
                let change = acceleration * STEP;
                self.velocity += (speed - self.velocity).clamp(-change, change);
                self.position += self.velocity * STEP;
            }
        }
    }

    fn step_to(&mut self, goal: f64, speed: f64, acceleration: f64) {
        let distance = goal - self.position;
        let change = acceleration * STEP;
        if distance.abs() <= speed * STEP && (self.velocity.abs() <= change || acceleration.is_infinite()) {
            let landing = distance / STEP;
            if (landing - self.velocity).abs() <= change || distance.abs() <= change * STEP {
                self.position = goal;
                self.velocity = 0.0;
                return;
            }
        }
        let wanted = speed.min(braking_speed(distance.abs(), acceleration)).copysign(distance);
        self.velocity += (wanted - self.velocity).clamp(-change, change);
        self.position += self.velocity * STEP;
    }
}

/// Highest speed from which steps of 1 ms can still brake within `distance`: the solution for v of
/// `distance = v * STEP + v * v / (2 * acceleration)`, less half a step of braking.
fn braking_speed(distance: f64, acceleration: f64) -> f64 {
    if acceleration.is_infinite() {
        return distance / STEP;
    }
    let half = acceleration * STEP / 2.0;
    (half * half + 2.0 * acceleration * distance).sqrt() - half
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps until it stands; positions and velocities after each step.
    fn run(motion: &mut Motion) -> Vec<(f64, f64)> {
        let mut trace = Vec::new();
        while !motion.at_rest() {
            motion.step();
            trace.push((motion.position, motion.velocity));
            assert!(trace.len() < 400_000, "never arrives: {motion:?}");
        }
        trace
    }

    #[test]
    fn a_trapezoid_takes_the_time_of_the_textbook() {
        // d = 2000, v = 1000, a = 2000: accelerates 0.5 s over 250, brakes likewise, 1500 at full speed: 2.5 s.
        let mut motion = Motion::new(1000.0);
        motion.go_to(3000.0, 1000.0, 2000.0, false);
        assert!(matches!(motion.drive, Drive::Position { profile: Profile::Trapezoidal, .. }));
        let trace = run(&mut motion);
        assert!((trace.len() as f64 * STEP - 2.5).abs() < 0.01, "took {} ms", trace.len());
        assert_eq!(motion.position, 3000.0);
        let mut before = 0.0;
        for (position, velocity) in trace {
            assert!(position <= 3000.0 && (0.0..=1000.0).contains(&velocity));
            assert!((velocity - before).abs() <= 2000.0 * STEP * 1.000_001 || velocity == 0.0);
            before = velocity;
        }
    }

    #[test]
    fn a_short_move_is_a_triangle() {
        // Peak speed sqrt(a d) = 447 of 1000; takes 2 sqrt(d / a) = 0.447 s.
        let mut motion = Motion::new(0.0);
        motion.go_to(-100.0, 1000.0, 2000.0, false);
        assert!(matches!(motion.drive, Drive::Position { profile: Profile::Triangular, .. }));
        let trace = run(&mut motion);
        assert!((trace.len() as f64 * STEP - 0.447).abs() < 0.01, "took {} ms", trace.len());
        let peak = trace.iter().fold(0.0_f64, |peak, (_, velocity)| peak.max(-velocity));
        assert!((peak - 447.2).abs() < 5.0, "peak {peak}");
    }

    #[test]
    fn without_acceleration_it_runs_at_full_speed_to_the_end() {
        let mut motion = Motion::new(0.0);
        motion.go_to(1500.0, 1000.0, f64::INFINITY, false);
        let trace = run(&mut motion);
        assert_eq!(trace.len(), 1500);
        assert!(trace[..1499].iter().all(|(_, velocity)| *velocity == 1000.0));
    }

    #[test]
    fn a_new_goal_turns_it_round_without_a_jump_in_velocity() {
        let mut motion = Motion::new(0.0);
        motion.go_to(1000.0, 500.0, 1000.0, false);
        (0..800).for_each(|_| motion.step());
        motion.go_to(0.0, 500.0, 1000.0, false);
        let mut before = motion.velocity;
        for (_, velocity) in run(&mut motion) {
            assert!((velocity - before).abs() <= 1000.0 * STEP * 1.000_001 || velocity == 0.0);
            before = velocity;
        }
        assert_eq!(motion.position, 0.0);
    }

    #[test]
    fn every_move_arrives() {
        for goal in [1.0, -1.0, 0.5, 3.0, 17.0, 4095.0, -4095.0] {
            for speed in [15.6, 300.0, 3140.0, 16_000.0] {
                for acceleration in [244.0, 2440.0, 1e6, 8e6, f64::INFINITY] {
                    let mut motion = Motion::new(0.0);
                    motion.go_to(goal, speed, acceleration, false);
                    run(&mut motion);
                    assert_eq!(motion.position, goal);
                }
            }
        }
    }

    #[test]
    fn velocity_drive_reaches_its_speed() {
        let mut motion = Motion::new(0.0);
        motion.drive = Drive::Velocity { speed: -100.0, acceleration: 1000.0 };
        (0..1000).for_each(|_| motion.step());
        assert!((motion.velocity + 100.0).abs() < 1e-9);
        assert!((motion.position + 95.0).abs() < 0.2, "{}", motion.position);
    }
}
