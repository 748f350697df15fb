//! What of a servo's settings is not as a puppet needs it, and what that would do.

use super::read::Settings;
use super::table::{Register, Role, registers};
use firmware::map::{BusKind, Joint};
use puppet_file::{Units, models};
use serde::Serialize;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Judged {
    /// The movement is the same; worth to know.
    Noted,
    /// The movement is another one than asked for, or may be.
    Warned,
    /// The movement is wrong: nothing is armed.
    Refused,
}

/// A setting that is not as it should be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mismatch {
    /// How bad it is.
    pub judged: Judged,
    /// The register's name in the manual, or what else is meant.
    pub register: &'static str,
    /// Its address.
    pub address: Option<u16>,
    /// What it is.
    pub found: String,
    /// What it should be.
    pub expected: String,
    /// What it does to the movement.
    pub effect: String,
    /// What it can be set to.
    pub fix: Option<i64>,
}

impl Mismatch {
    /// The sentence about it, without the servo.
    #[must_use]
    pub fn sentence(&self) -> String {
        let address = self.address.map_or(String::new(), |address| format!(" ({address})"));
        let Self { register, found, expected, effect, .. } = self;
        format!("{register}{address} is {found}, expected {expected}: {effect}")
    }
}

/// What a puppet expects of a servo.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expected {
    /// Its number.
    pub id: u8,
    /// The joint's name; empty where no puppet was given.
    pub name: String,
    /// The model that the puppet says.
    pub model: Option<u16>,
    /// The joint on a device; `None` without a puppet, or where the puppet has mistakes.
    pub joint: Option<Joint>,
    /// Goals a second, for speeds.
    pub servo_hz: f64,
    /// The other ids on the bus.
    pub others: Vec<u8>,
    /// Milliseconds of silence after which the player lets servos stop; 0: it leaves their watchdogs alone.
    pub watchdog_millis: u16,
}

impl Expected {
    /// Goals in a degree, or in a centimetre.
    fn scale(&self) -> Option<f64> {
        self.joint.map(|joint| joint.scale.to_num::<f64>())
    }

    /// The joint's highest speed in goals a second.
    fn speed(&self) -> Option<f64> {
        self.joint.map(|joint| f64::from(joint.max_velocity) / 1024.0 * self.servo_hz)
    }
}

/// Collects what is found about one servo.
struct Judge<'a> {
    settings: &'a Settings,
    expected: &'a Expected,
    found: Vec<Mismatch>,
}

/// All that is not as it should be.
#[must_use]
pub fn judge(settings: &Settings, expected: &Expected) -> Vec<Mismatch> {
    let mut judge = Judge { settings, expected, found: Vec::new() };
    judge.model();
    judge.return_level();
    judge.mode();
    judge.torque();
    judge.drive();
    judge.homing();
    judge.speeds();
    judge.bus();
    judge.found
}

/// A servo that says that it is there and answers no read.
#[must_use]
pub fn mute(kind: BusKind) -> Mismatch {
    let register = registers(kind).iter().find(|register| register.role == Role::ReturnLevel);
    Mismatch {
        judged: Judged::Refused,
        register: register.map_or("Status Return Level", |register| register.name),
        address: register.map(|register| register.address),
        found: "0, it seems".to_owned(),
        expected: all_answers(kind).to_string(),
        effect: "it answers pings and no reads, so nobody can see where it is".to_owned(),
        fix: Some(all_answers(kind)),
    }
}

/// The Status Return Level with which a servo answers everything.
const fn all_answers(kind: BusKind) -> i64 {
    if matches!(kind, BusKind::Sts | BusKind::Scs) { 1 } else { 2 }
}

impl Judge<'_> {
    fn register(&self, role: Role) -> Option<(&'static Register, i64)> {
        self.settings.each().find(|(register, _)| register.role == role)
    }

    fn get(&self, role: Role) -> i64 {
        self.settings.get(role).unwrap_or(0)
    }

    fn add(&mut self, role: Role, judged: Judged, texts: [String; 3], fix: Option<i64>) {
        let [found, expected, effect] = texts;
        if let Some((register, _)) = self.register(role) {
            let (address, register) = (Some(register.address), register.name);
            self.found.push(Mismatch { judged, register, address, found, expected, effect, fix });
        }
    }

    /// The model, and whether its goals are those that the puppet counts in.
    fn model(&mut self) {
        let (kind, model) = (self.settings.kind, self.settings.identity.model);
        let name = models::name(model);
        let mut add = |judged, expected: String, effect: String| {
            let found = name.clone();
            let register = "Model Number";
            let mismatch = Mismatch { judged, register, address: None, found, expected, effect, fix: None };
            self.found.push(mismatch);
        };
        if let Some(expected) = self.expected.model.filter(|expected| *expected != model) {
            add(
                Judged::Warned,
                models::name(expected),
                "it may be another servo than the puppet means".to_owned(),
            );
        }
        if let Some(why) = models::unfit(kind, model) {
            add(Judged::Refused, "another servo".to_owned(), why.to_owned());
        }
        let (assumed, real) = (Units::of(kind, self.expected.model), Units::of(kind, Some(model)));
        let scaled =
            self.expected.scale().is_some_and(|scale| (scale.abs() - assumed.per_degree).abs() > 0.01);
        if assumed != real && self.expected.joint.is_some() && !scaled {
            add(
                Judged::Refused,
                format!("a servo with {:.3} goals a degree", assumed.per_degree),
                format!(
                    "it has {:.3}, so each movement would be {:.2} times as far as asked for: give the joint model = \"{name}\"",
                    real.per_degree,
                    assumed.per_degree / real.per_degree
                ),
            );
        }
    }

    fn return_level(&mut self) {
        let (level, all) = (self.get(Role::ReturnLevel), all_answers(self.settings.kind));
        if level < all {
            let effect =
                "it does what it is told and does not confirm it, so that nobody can know whether it holds";
            let texts = [level.to_string(), all.to_string(), effect.to_owned()];
            self.add(Role::ReturnLevel, Judged::Refused, texts, Some(all));
        }
    }

    /// Whether goals are positions, and which ones it takes.
    fn mode(&mut self) {
        let (low, high) = (self.get(Role::MinPosition), self.get(Role::MaxPosition));
        let Units { highest, .. } = Units::of(self.settings.kind, Some(self.settings.identity.model));
        let most = i64::from(highest);
        let whole = self.get(Role::MaxVoltage) != 0;
        match self.settings.kind {
            BusKind::Dynamixel => match self.get(Role::Mode) {
                3 => self.limits(low, high),
                4 => self.turns(Role::Mode, "4 (extended position)", "3 (position)", Some(3)),
                5 => self.turns(Role::Mode, "5 (current-based position)", "3 (position)", Some(3)),
                mode => {
                    let name = match mode {
                        0 => " (current)",
                        1 => " (velocity)",
                        16 => " (PWM)",
                        _ => "",
                    };
                    self.wrong_mode(Role::Mode, format!("{mode}{name}"), "3 (position)", Some(3));
                    self.limits(low, high);
                }
            },
            BusKind::Dynamixel1 if (low, high) == (0, 0) => {
                let found = "0, and CW Angle Limit (6) too (wheel mode)".to_owned();
                self.wrong_mode(Role::MaxPosition, found, &most.to_string(), Some(most));
            }
            BusKind::Dynamixel1 if (low, high) == (most, most) && most > 1023 => {
                self.turns(Role::MinPosition, "4095, and CCW Angle Limit (8) too (multi-turn)", "0", Some(0));
            }
            BusKind::Sts => match self.get(Role::Mode) {
                0 if (low, high) == (0, 0) => {
                    self.beyond_turn(Role::MaxPosition, "0 (no limits)", "4095", None);
                }
                0 => self.limits(low, high),
                mode => {
                    let name = match mode {
                        1 => " (wheel)",
                        2 => " (PWM)",
                        3 => " (step)",
                        _ => "",
                    };
                    self.wrong_mode(Role::Mode, format!("{mode}{name}"), "0 (position)", Some(0));
                    if (low, high) != (0, 0) {
                        self.limits(low, high);
                    }
                }
            },
            BusKind::Scs if (low, high) == (0, 0) && whole => {
                let found = "0, and Min Angle Limit (9) too (wheel mode)".to_owned();
                self.wrong_mode(Role::MaxPosition, found, &most.to_string(), Some(most));
            }
            BusKind::Scs if (low, high) == (0, 0) => {}
            _ => self.limits(low, high),
        }
    }

    fn wrong_mode(&mut self, role: Role, found: String, expected: &str, fix: Option<i64>) {
        let effect = "a goal is no position to it: it does not go where it is told".to_owned();
        self.add(role, Judged::Refused, [found, expected.to_owned(), effect], fix);
    }

    /// A mode with several turns, which is good where the servo stands in its first one.
    fn turns(&mut self, role: Role, found: &str, expected: &str, fix: Option<i64>) {
        if self.beyond_turn(role, found, expected, fix) {
            return;
        }
        let effect = "its own position limits do not hold, and after some turns by hand it would be refused"
            .to_owned();
        self.add(role, Judged::Warned, [found.to_owned(), expected.to_owned(), effect], fix);
        if self.get(Role::Mode) == 5 && self.get(Role::GoalCurrent) == 0 {
            let effect = "in mode 5 it may use no current, so it does not move".to_owned();
            let limit = self.get(Role::CurrentLimit);
            let texts = ["0".to_owned(), limit.to_string(), effect];
            self.add(Role::GoalCurrent, Judged::Refused, texts, Some(limit).filter(|limit| *limit > 0));
        }
    }

    /// Whether it counts turns and stands in another one than the first.
    fn beyond_turn(&mut self, role: Role, found: &str, expected: &str, fix: Option<i64>) -> bool {
        let position = self.get(Role::Position);
        let Units { highest, .. } = Units::of(self.settings.kind, Some(self.settings.identity.model));
        let beyond = !(0..=i64::from(highest)).contains(&position);
        if beyond {
            let effect = format!(
                "it counts turns and stands at {position}, so it would run all the way back to its first turn: turn it there by hand"
            );
            self.add(role, Judged::Refused, [found.to_owned(), expected.to_owned(), effect], fix);
        }
        beyond
    }

    /// The servo's own limits, which may be narrower than the joint's range.
    fn limits(&mut self, low: i64, high: i64) {
        let Some(joint) = self.expected.joint else {
            let most = i64::from(Units::of(self.settings.kind, Some(self.settings.identity.model)).highest);
            if low > 0 || high < most {
                let role = if low > 0 { Role::MinPosition } else { Role::MaxPosition };
                let found = format!("part of limits from {low} to {high}");
                let texts = [found, format!("0 to {most}"), "it takes no goals beyond".to_owned()];
                self.add(role, Judged::Noted, texts, None);
            }
            return;
        };
        let scale = self.expected.scale().unwrap_or(1.0);
        let value = |goal: i64| (goal as f64 - f64::from(joint.zero)) / scale;
        let refuses = if self.settings.kind == BusKind::Dynamixel || self.settings.kind == BusKind::Dynamixel1
        {
            "it refuses goals beyond that, and stands still"
        } else {
            "it stops there"
        };
        let effect = |end: i64, wanted: i64| {
            format!("the joint goes to {:.1}, the servo to {:.1}: {refuses}", value(wanted), value(end))
        };
        let (min, max) = (i64::from(joint.min), i64::from(joint.max));
        if low > min {
            let texts = [low.to_string(), format!("{min} or less"), effect(low, min)];
            self.add(Role::MinPosition, Judged::Refused, texts, Some(min));
        }
        if high < max {
            let texts = [high.to_string(), format!("{max} or more"), effect(high, max)];
            self.add(Role::MaxPosition, Judged::Refused, texts, Some(max));
        }
    }

    /// How strong it may be. A table whose other values are 0 is not kept by whoever answers, and says nothing.
    fn torque(&mut self) {
        let no_power = || "it may use no power, so it does not move".to_owned();
        let weaker =
            |part: f64| format!("it is weaker than it could be, with {:.0} % of its power", 100.0 * part);
        let (pwm, max) = (self.get(Role::PwmLimit), self.get(Role::MaxTorque));
        match self.settings.kind {
            BusKind::Dynamixel => {
                const ALL: i64 = 885;
                if pwm == 0 && self.get(Role::Gain) != 0 {
                    let texts = ["0".to_owned(), ALL.to_string(), no_power()];
                    self.add(Role::PwmLimit, Judged::Refused, texts, Some(ALL));
                }
                let goal = self.get(Role::GoalPwm);
                if self.get(Role::Gain) != 0 && pwm > 0 && goal < pwm {
                    let (judged, effect) = match goal {
                        0 => (Judged::Refused, no_power()),
                        goal => (Judged::Warned, weaker(goal as f64 / ALL as f64)),
                    };
                    self.add(Role::GoalPwm, judged, [goal.to_string(), pwm.to_string(), effect], Some(pwm));
                }
            }
            BusKind::Dynamixel1 | BusKind::Sts => {
                let all = if self.settings.kind == BusKind::Sts { 1000 } else { 1023 };
                let (limit, most) = (self.get(Role::TorqueLimit), if max > 0 { max } else { all });
                let kept = self.settings.kind == BusKind::Dynamixel1 || self.get(Role::MaxVoltage) > 0;
                if limit == 0 && kept {
                    let why = ", as after an overload";
                    let why = if self.settings.kind == BusKind::Dynamixel1 { why } else { "" };
                    let texts = [format!("0{why}"), most.to_string(), no_power()];
                    self.add(Role::TorqueLimit, Judged::Refused, texts, Some(most));
                } else if limit < most && kept {
                    let texts = [limit.to_string(), most.to_string(), weaker(limit as f64 / all as f64)];
                    self.add(Role::TorqueLimit, Judged::Warned, texts, Some(most));
                }
            }
            BusKind::Scs if max == 0 && self.get(Role::MaxVoltage) > 0 => {
                self.add(
                    Role::MaxTorque,
                    Judged::Refused,
                    ["0".to_owned(), "1000".to_owned(), no_power()],
                    Some(1000),
                );
            }
            _ => {}
        }
        let error = self.get(Role::HardwareError);
        if error != 0 {
            let effect = "it does not hold until it is restarted, which the player tries once".to_owned();
            self.add(Role::HardwareError, Judged::Warned, [error.to_string(), "0".to_owned(), effect], None);
        }
    }

    fn drive(&mut self) {
        if self.settings.kind != BusKind::Dynamixel {
            return;
        }
        let drive = self.get(Role::Drive);
        let moves = self.get(Role::Velocity) != 0 || self.get(Role::Acceleration) != 0;
        let mut wrong = Vec::new();
        if drive & 1 != 0 {
            wrong.push("it turns the other way round, unless the puppet was measured with it so");
        }
        if drive & 2 != 0 {
            wrong.push("it follows another servo");
        }
        if drive & 4 != 0 && moves {
            wrong.push("each goal takes a fixed time, so the movement comes late");
        }
        if drive & 8 != 0 {
            wrong.push("a goal turns its torque on");
        }
        if !wrong.is_empty() {
            let texts = [drive.to_string(), "0".to_owned(), wrong.join("; ")];
            self.add(Role::Drive, Judged::Warned, texts, Some(0));
        }
    }

    fn homing(&mut self) {
        let offset = self.get(Role::Homing);
        if offset != 0 {
            let degrees = offset as f64 * 360.0 / 4096.0;
            let effect = format!(
                "all its positions are shifted by {degrees:.1} degrees, unless the puppet was measured with it so"
            );
            self.add(Role::Homing, Judged::Warned, [offset.to_string(), "0".to_owned(), effect], Some(0));
        }
    }

    /// Speed and acceleration of a move, 0 being as fast as it can.
    fn speeds(&mut self) {
        let units = Units::of(self.settings.kind, Some(self.settings.identity.model));
        // Goals a second of one unit.
        let unit = match self.settings.kind {
            BusKind::Dynamixel => 0.229 / 60.0 * 4096.0,
            // 0.114 rpm of an MX, 0.111 rpm of an AX.
            BusKind::Dynamixel1 if units.highest > 1023 => 0.114 / 60.0 * 4096.0,
            BusKind::Dynamixel1 => 0.111 / 60.0 * 1228.8,
            _ => 1.0,
        };
        let timed = self.settings.kind == BusKind::Dynamixel && self.get(Role::Drive) & 4 != 0;
        let velocity = self.get(Role::Velocity).abs();
        if velocity != 0 && !timed {
            let goals = velocity as f64 * unit;
            let (judged, effect) = match (self.expected.speed(), self.expected.scale()) {
                (Some(speed), Some(scale)) if goals < speed => {
                    let of = |goals: f64| goals / scale.abs();
                    let late = format!(
                        "it does {:.0} a second where the joint's max_speed is {:.0}, so the movement comes late",
                        of(goals),
                        of(speed)
                    );
                    (Judged::Warned, late)
                }
                _ => (Judged::Noted, "it has a speed of its own, above the joint's".to_owned()),
            };
            self.add(Role::Velocity, judged, [velocity.to_string(), "0 (none)".to_owned(), effect], Some(0));
        }
        if timed && velocity != 0 {
            let texts =
                [format!("{velocity} ms"), "0 (none)".to_owned(), "each goal takes so long".to_owned()];
            self.add(Role::Velocity, Judged::Warned, texts, Some(0));
        }
        let acceleration = self.get(Role::Acceleration);
        let of_profile = self.settings.kind != BusKind::Dynamixel || velocity != 0;
        if acceleration != 0 && of_profile {
            let goals = acceleration as f64
                * if self.settings.kind == BusKind::Dynamixel { 214.577 / 3600.0 * 4096.0 } else { 100.0 };
            let wanted = self.expected.joint.map(|joint| {
                f64::from(joint.max_acceleration) / 1024.0 * self.expected.servo_hz * self.expected.servo_hz
            });
            if wanted.is_some_and(|wanted| goals < wanted) && !timed {
                let effect =
                    "it gets faster more slowly than the joint may, so quick movements come late".to_owned();
                let texts = [acceleration.to_string(), "0 (none)".to_owned(), effect];
                self.add(Role::Acceleration, Judged::Warned, texts, Some(0));
            }
        }
        let time = self.get(Role::Time);
        if time != 0 {
            let texts = [format!("{time} ms"), "0 (none)".to_owned(), "each goal takes so long".to_owned()];
            self.add(Role::Time, Judged::Warned, texts, Some(0));
        }
    }

    /// What only the bus feels.
    fn bus(&mut self) {
        let watchdog = self.get(Role::Watchdog);
        if watchdog != 0 {
            let sets = self.expected.watchdog_millis > 0 || self.expected.joint.is_none();
            let (found, effect) = match watchdog {
                255 => ("255 (it stopped the servo)".to_owned(), "it refuses goals until this is 0"),
                units => {
                    (format!("{units} ({} ms)", units * 20), "it stops where the bus is silent for so long")
                }
            };
            let judged = match (sets, watchdog) {
                // The player sets it itself.
                (true, _) => Judged::Noted,
                (false, 255) => Judged::Refused,
                (false, _) => Judged::Warned,
            };
            self.add(Role::Watchdog, judged, [found, "0".to_owned(), effect.to_owned()], Some(0));
        }
        let second = self.get(Role::SecondaryId);
        if self.settings.kind == BusKind::Dynamixel
            && u8::try_from(second).is_ok_and(|id| self.expected.others.contains(&id))
        {
            let effect = format!("it obeys what servo {second} is told");
            let texts = [second.to_string(), "255 (none)".to_owned(), effect];
            self.add(Role::SecondaryId, Judged::Warned, texts, Some(255));
        }
        let delay = self.get(Role::ReturnDelay);
        if delay > 0 {
            let effect = format!("each answer comes {} µs later than it could", delay * 2);
            self.add(Role::ReturnDelay, Judged::Noted, [delay.to_string(), "0".to_owned(), effect], Some(0));
        }
    }
}
