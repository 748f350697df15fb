//! One servo: what reading, writing and time do to it.

use crate::config::ServoConfig;
use crate::control_table::{
    ACCELERATION_UNIT, INPUT_VOLTAGE, Layout, MOTOR_SPEED, MULTI_TURN_LIMIT, SIZE, TEMPERATURE, VELOCITY_UNIT,
};
use crate::group::SimulatedServo;
use crate::memory::{Change, Memory};
use crate::motion::{Drive, Motion};
use servo_wire::dynamixel::ErrorNumber;
use servo_wire::dynamixel::table::*;

/// Velocity mode of Operating Mode (11).
const VELOCITY_MODE: i64 = 1;
/// Position mode, within one turn.
const POSITION_MODE: i64 = 3;
/// Position mode without limits, and the same with a limit of the current.
const EXTENDED_POSITION_MODE: i64 = 4;
const CURRENT_BASED_POSITION_MODE: i64 = 5;
/// The first firmware that has Fast Sync Read and Fast Bulk Read.
const FAST_READ_FIRMWARE: i64 = 45;
/// Bits of Drive Mode (10).
const REVERSE: i64 = 0x01;
const TIME_BASED: i64 = 0x04;
const TORQUE_ON_BY_GOAL: i64 = 0x08;
/// Bus Watchdog (98) after it has tripped: -1.
const TRIPPED: i64 = 255;
/// Parameters of a Clear that brings the position back into one turn.
const CLEAR_TURNS: [u8; 5] = [0x01, 0x44, 0x58, 0x4C, 0x22];
/// Microseconds in a step of the motion.
const STEP_US: u64 = 1000;

/// One servo.
pub(crate) struct DynamixelServo {
    memory: Memory,
    motion: Motion,
    /// What Reg Write left for Action: address and bytes.
    registered: Option<(u16, Vec<u8>)>,
    /// Simulated up to here.
    now_us: u64,
    started_us: u64,
    heard_us: u64,
}

impl DynamixelServo {
    pub fn new(config: ServoConfig) -> Self {
        let mut servo = Self {
            memory: Memory::new(Layout::X),
            motion: Motion::new(f64::from(config.position)),
            registered: None,
            now_us: 0,
            started_us: 0,
            heard_us: 0,
        };
        servo.memory.set(ID, i64::from(config.id));
        servo.memory.set(MIN_POSITION_LIMIT, i64::from(config.min_position));
        servo.memory.set(MAX_POSITION_LIMIT, i64::from(config.max_position));
        servo.memory.set(GOAL_POSITION, i64::from(config.position));
        servo.publish();
        servo
    }

    pub fn id(&self) -> u8 {
        self.memory.get(ID) as u8
    }

    /// Whether `id` is the secondary id, which is obeyed without an answer.
    pub fn follows(&self, id: u8) -> bool {
        id <= servo_wire::dynamixel::MAX_ID && self.memory.get(SECONDARY_ID) == i64::from(id)
    }

    /// Status Return Level: 0 ping, 1 reads as well, 2 everything.
    pub fn return_level(&self) -> i64 {
        self.memory.get(STATUS_RETURN_LEVEL)
    }

    /// Whether the alert bit of every answer is set.
    pub fn alert(&self) -> bool {
        self.memory.get(HARDWARE_ERROR_STATUS) != 0
    }

    /// Model number and firmware version, the answer to a ping.
    pub fn identity(&self) -> Result<Vec<u8>, ErrorNumber> {
        let mut answer = self.memory.read(MODEL_NUMBER.address, MODEL_NUMBER.len)?;
        answer.extend(self.memory.read(FIRMWARE_VERSION.address, FIRMWARE_VERSION.len)?);
        Ok(answer)
    }

    pub fn read(&self, address: u16, len: u16) -> Result<Vec<u8>, ErrorNumber> {
        self.memory.read(address, len)
    }

    /// Any instruction on the bus keeps the watchdog quiet.
    pub fn hear(&mut self) {
        self.heard_us = self.now_us;
    }

    /// Writes and returns the new goal position, if there is one. A refused write changes nothing. `as_group`: by the
    /// secondary id, which reaches RAM only.
    ///
    /// # Errors
    /// As the manual lists under "Error" of the status packet. Turning torque on after a shutdown is `ResultFail`:
    /// the manual only says that it takes a reboot.
    pub fn write(&mut self, address: u16, data: &[u8], as_group: bool) -> Result<Option<i32>, ErrorNumber> {
        let changes = self.accept(address, data, as_group)?;
        for change in &changes {
            self.apply(*change);
        }
        self.detect_faults();
        self.publish();
        let goal = changes.iter().rfind(|change| change.register == GOAL_POSITION);
        Ok(goal.map(|change| change.value as i32))
    }

    /// Keeps a write for [`action`](Self::action); one that would be refused now is refused now.
    pub fn register(&mut self, address: u16, data: &[u8], as_group: bool) -> Result<(), ErrorNumber> {
        self.accept(address, data, as_group)?;
        self.registered = Some((address, data.to_vec()));
        self.memory.set(REGISTERED_INSTRUCTION, 1);
        Ok(())
    }

    /// Carries out the registered write.
    pub fn action(&mut self) -> Result<Option<i32>, ErrorNumber> {
        let (address, data) = self.registered.take().ok_or(ErrorNumber::Instruction)?;
        self.memory.set(REGISTERED_INSTRUCTION, 0);
        self.write(address, &data, false)
    }

    /// Starts anew: RAM at its defaults, faults forgotten, torque off, the position within one turn.
    pub fn reboot(&mut self) {
        self.memory.restart();
        self.motion.release();
        self.wrap();
        self.memory.set(GOAL_POSITION, self.motion.position.round() as i64);
        self.registered = None;
        self.started_us = self.now_us;
        self.heard_us = self.now_us;
        self.detect_faults();
        self.publish();
    }

    /// Factory defaults, except id (option 1) or id and baud rate (option 2), and a restart.
    pub fn factory_reset(&mut self, option: u8) -> Result<(), ErrorNumber> {
        let kept: &[Register] = match option {
            0xFF => &[],
            0x01 => &[ID],
            0x02 => &[ID, BAUD_RATE],
            _ => return Err(ErrorNumber::DataRange),
        };
        let shaft = self.shaft();
        let old = std::mem::replace(&mut self.memory, Memory::new(Layout::X));
        self.become_model(old.get(MODEL_NUMBER));
        self.memory.set(FIRMWARE_VERSION, old.get(FIRMWARE_VERSION));
        for &register in kept {
            self.memory.set(register, old.get(register));
        }
        self.place(shaft);
        self.reboot();
        Ok(())
    }

    /// Brings the position back into one turn; refused while moving.
    pub fn clear(&mut self, parameters: &[u8]) -> Result<(), ErrorNumber> {
        if parameters != CLEAR_TURNS {
            return Err(ErrorNumber::DataRange);
        }
        if !self.motion.at_rest() {
            return Err(ErrorNumber::ResultFail);
        }
        self.wrap();
        if self.torque() {
            self.hold();
        }
        self.publish();
        Ok(())
    }

    /// Where the shaft is, in goal units.
    pub fn position(&self) -> i32 {
        self.motion.position.round() as i32
    }

    /// Somebody turns the shaft; a motor that holds does not let them.
    pub fn turn(&mut self, position: i32) {
        if !self.torque() {
            self.motion.position = f64::from(position);
            self.publish();
        }
    }

    /// Writes into the table what the servo itself might refuse; one byte where no register begins.
    pub fn set(&mut self, address: u16, value: i64) {
        let entry = self.memory.layout().entry_at(address);
        let register = entry.map_or(Register { address, len: 1 }, |entry| entry.register);
        if register == MODEL_NUMBER {
            self.become_model(value);
        } else if usize::from(address) < SIZE {
            self.memory.set(register, value);
        }
        self.publish();
    }

    /// Takes the table of a model.
    fn become_model(&mut self, model: i64) {
        self.memory = self.memory.in_layout(Layout::of(model));
        self.memory.set(MODEL_NUMBER, model);
    }

    /// Whether its firmware has Fast Sync Read and Fast Bulk Read.
    pub fn has_fast_reads(&self) -> bool {
        self.memory.get(FIRMWARE_VERSION) >= FAST_READ_FIRMWARE
    }

    /// Whether a goal position moves it: by its mode, and by the power that it is allowed.
    fn obeys_positions(&self) -> bool {
        let allowed = match self.mode() {
            POSITION_MODE | EXTENDED_POSITION_MODE => true,
            CURRENT_BASED_POSITION_MODE => self.memory.get(GOAL_CURRENT) != 0,
            _ => false,
        };
        allowed && self.memory.get(GOAL_PWM) != 0 && self.memory.get(PWM_LIMIT) != 0
    }

    /// Lets time pass until `now_us`.
    pub fn advance_to(&mut self, now_us: u64) {
        while self.now_us + STEP_US <= now_us {
            self.watch();
            if self.motion.at_rest() {
                // Only the watchdog can still happen, and it finds the shaft at rest whenever it looks.
                self.now_us += (now_us - self.now_us) / STEP_US * STEP_US;
                self.watch();
                break;
            }
            self.motion.step();
            self.now_us += STEP_US;
        }
        self.publish();
    }

    fn accept(&self, address: u16, data: &[u8], as_group: bool) -> Result<Vec<Change>, ErrorNumber> {
        let changes = self.memory.changes(address, data, self.torque() || as_group)?;
        changes.iter().try_for_each(|change| self.check(*change))?;
        Ok(changes)
    }

    /// The rules that need more than the register's own range.
    fn check(&self, Change { register, value }: Change) -> Result<(), ErrorNumber> {
        let is_goal = [GOAL_PWM, GOAL_CURRENT, GOAL_VELOCITY, GOAL_POSITION].contains(&register);
        if self.tripped() && (is_goal || (register == BUS_WATCHDOG && value != 0)) {
            return Err(ErrorNumber::DataRange);
        }
        let within = |limit| value.abs() <= self.memory.get(limit);
        let (ok, error) = match register {
            GOAL_POSITION if self.mode() == POSITION_MODE => {
                let limits = self.memory.get(MIN_POSITION_LIMIT)..=self.memory.get(MAX_POSITION_LIMIT);
                (limits.contains(&value), ErrorNumber::DataLimit)
            }
            GOAL_POSITION => (value.abs() <= MULTI_TURN_LIMIT, ErrorNumber::DataRange),
            GOAL_VELOCITY => (within(VELOCITY_LIMIT), ErrorNumber::DataLimit),
            GOAL_CURRENT => (within(CURRENT_LIMIT), ErrorNumber::DataLimit),
            GOAL_PWM => (within(PWM_LIMIT), ErrorNumber::DataLimit),
            DRIVE_MODE => (value & !(REVERSE | TIME_BASED | TORQUE_ON_BY_GOAL) == 0, ErrorNumber::DataRange),
            OPERATING_MODE => (value != 2, ErrorNumber::DataRange),
            TORQUE_ENABLE => (value == 0 || !self.shut_down(), ErrorNumber::ResultFail),
            _ => (true, ErrorNumber::ResultFail),
        };
        if ok { Ok(()) } else { Err(error) }
    }

    fn apply(&mut self, Change { register, value }: Change) {
        let was_on = self.torque();
        let shaft = self.shaft();
        self.memory.set(register, value);
        match register {
            TORQUE_ENABLE if value == 1 && !was_on => self.torque_on(),
            TORQUE_ENABLE if value == 0 => self.motion.release(),
            HOMING_OFFSET | DRIVE_MODE => self.place(shaft),
            OPERATING_MODE => self.change_mode(shaft),
            BUS_WATCHDOG => self.heard_us = self.now_us,
            GOAL_POSITION | GOAL_VELOCITY => {
                let by_goal = self.memory.get(DRIVE_MODE) & TORQUE_ON_BY_GOAL != 0;
                if !was_on && by_goal && !self.shut_down() {
                    self.memory.set(TORQUE_ENABLE, 1);
                    self.torque_on();
                    self.memory.set(register, value);
                }
                self.set_off(register);
            }
            _ => {}
        }
    }

    fn mode(&self) -> i64 {
        self.memory.get(OPERATING_MODE)
    }

    fn torque(&self) -> bool {
        self.memory.get(TORQUE_ENABLE) == 1
    }

    fn tripped(&self) -> bool {
        self.memory.get(BUS_WATCHDOG) == TRIPPED
    }

    /// Whether a hardware error that Shutdown (63) names has happened since the last start.
    fn shut_down(&self) -> bool {
        self.memory.get(HARDWARE_ERROR_STATUS) & self.memory.get(SHUTDOWN) != 0
    }

    /// Torque comes on: the position is brought into one turn (position mode), and the goal is where the shaft is, so
    /// that nothing jumps.
    fn torque_on(&mut self) {
        if self.mode() == POSITION_MODE {
            self.wrap();
        }
        self.hold();
        if self.mode() == VELOCITY_MODE {
            self.set_off(GOAL_VELOCITY);
        }
    }

    /// Makes the present position the goal.
    fn hold(&mut self) {
        let position = self.motion.position;
        self.memory.set(GOAL_POSITION, position.round() as i64);
        self.motion.velocity = 0.0;
        self.motion.go_to(position, MOTOR_SPEED, f64::INFINITY, true);
    }

    /// Starts moving for a goal that was written.
    fn set_off(&mut self, goal: Register) {
        let obeys = if goal == GOAL_VELOCITY { self.mode() == VELOCITY_MODE } else { self.obeys_positions() };
        if !self.torque() || !obeys {
            return;
        }
        let (profile_velocity, profile_acceleration) =
            (self.memory.get(PROFILE_VELOCITY) as f64, self.memory.get(PROFILE_ACCELERATION) as f64);
        let time_based = self.memory.get(DRIVE_MODE) & TIME_BASED != 0;
        let infinite = |units: f64| if units == 0.0 { f64::INFINITY } else { units * ACCELERATION_UNIT };
        if goal == GOAL_VELOCITY {
            let speed = self.memory.get(GOAL_VELOCITY) as f64 * VELOCITY_UNIT;
            let speed = speed.clamp(-MOTOR_SPEED, MOTOR_SPEED);
            let acceleration = match (time_based, profile_acceleration == 0.0) {
                (true, false) => (speed - self.motion.velocity).abs() / (profile_acceleration / 1000.0),
                _ => infinite(profile_acceleration),
            };
            self.motion.drive = Drive::Velocity { speed, acceleration };
            return;
        }
        let goal = self.memory.get(GOAL_POSITION) as f64;
        if profile_velocity == 0.0 {
            self.motion.go_to(goal, MOTOR_SPEED, f64::INFINITY, true);
        } else if time_based {
            let total = profile_velocity / 1000.0;
            let rise = (profile_acceleration / 1000.0).min(total / 2.0);
            // Never slower than one unit, or a goal right here would never be reached from full speed.
            let speed =
                ((goal - self.motion.position).abs() / (total - rise)).clamp(VELOCITY_UNIT, MOTOR_SPEED);
            let acceleration = if rise == 0.0 { f64::INFINITY } else { speed / rise };
            self.motion.go_to(goal, speed, acceleration, false);
        } else {
            let limit = self.memory.get(VELOCITY_LIMIT) as f64;
            let speed = (profile_velocity.min(limit) * VELOCITY_UNIT).min(MOTOR_SPEED);
            self.motion.go_to(goal, speed, infinite(profile_acceleration), false);
        }
    }

    /// A new operating mode resets the profile and the goals that are limits.
    fn change_mode(&mut self, shaft: f64) {
        self.memory.set(PROFILE_VELOCITY, 0);
        self.memory.set(PROFILE_ACCELERATION, 0);
        self.memory.set(GOAL_PWM, self.memory.get(PWM_LIMIT));
        self.memory.set(GOAL_CURRENT, self.memory.get(CURRENT_LIMIT));
        self.place(shaft);
        if self.mode() == POSITION_MODE {
            self.wrap();
        }
    }

    fn direction(&self) -> f64 {
        if self.memory.get(DRIVE_MODE) & REVERSE != 0 { -1.0 } else { 1.0 }
    }

    /// Homing offset; in position mode only up to a quarter turn counts.
    fn offset(&self) -> f64 {
        let offset = self.memory.get(HOMING_OFFSET);
        if self.mode() == POSITION_MODE && offset.abs() > 1024 { 0.0 } else { offset as f64 }
    }

    /// Where the shaft is, whatever direction and offset.
    fn shaft(&self) -> f64 {
        self.direction() * (self.motion.position - self.offset())
    }

    /// Sees the shaft through the present direction and offset.
    fn place(&mut self, shaft: f64) {
        self.motion.position = self.direction() * shaft + self.offset();
    }

    /// Forgets whole turns.
    fn wrap(&mut self) {
        let turn = f64::from(POSITIONS_PER_TURN);
        self.motion.position = (self.motion.position - self.offset()).rem_euclid(turn) + self.offset();
    }

    /// Stops the servo when the bus was silent for too long; only while torque is on.
    fn watch(&mut self) {
        let limit_us = match self.memory.get(BUS_WATCHDOG) {
            0 | TRIPPED => return,
            units => units as u64 * 20_000,
        };
        if self.torque() && self.now_us.saturating_sub(self.heard_us) > limit_us {
            self.memory.set(BUS_WATCHDOG, TRIPPED);
            self.hold();
        }
    }

    /// Heat and voltage against their limits. Errors stay until a reboot; those in Shutdown (63) end torque.
    fn detect_faults(&mut self) {
        let voltage = self.memory.get(MIN_VOLTAGE_LIMIT)..=self.memory.get(MAX_VOLTAGE_LIMIT);
        let mut errors = self.memory.get(HARDWARE_ERROR_STATUS);
        errors |= i64::from(!voltage.contains(&INPUT_VOLTAGE));
        errors |= i64::from(TEMPERATURE > self.memory.get(TEMPERATURE_LIMIT)) << 2;
        self.memory.set(HARDWARE_ERROR_STATUS, errors);
        if self.shut_down() {
            self.memory.set(TORQUE_ENABLE, 0);
            self.motion.release();
        }
    }

    /// Puts what is measured into the table.
    fn publish(&mut self) {
        let position = self.motion.position.round() as i64;
        let velocity = (self.motion.velocity / VELOCITY_UNIT).round() as i64;
        let (profile, arrived) = match self.motion.drive {
            Drive::Position { profile, .. } => (profile as i64, self.motion.arrived()),
            _ => (0, true),
        };
        let moving = !arrived || velocity.abs() > self.memory.get(MOVING_THRESHOLD);
        let in_position = arrived && matches!(self.motion.drive, Drive::Position { .. });
        for (register, value) in [
            (PRESENT_POSITION, position),
            (POSITION_TRAJECTORY, position),
            (PRESENT_VELOCITY, velocity),
            (VELOCITY_TRAJECTORY, velocity),
            (MOVING, i64::from(moving)),
            (MOVING_STATUS, profile | i64::from(!arrived) << 1 | i64::from(in_position)),
            (REALTIME_TICK, ((self.now_us - self.started_us) / 1000 % 32_768) as i64),
        ] {
            self.memory.set(register, value);
        }
    }
}

impl SimulatedServo for DynamixelServo {
    fn id(&self) -> u8 {
        self.id()
    }

    fn position(&self) -> i32 {
        self.position()
    }

    fn advance_to(&mut self, now_us: u64) {
        self.advance_to(now_us);
    }

    fn reboot(&mut self) {
        self.reboot();
    }

    fn turn(&mut self, position: i32) {
        self.turn(position);
    }

    fn set(&mut self, address: u16, value: i64) {
        self.set(address, value);
    }
}
