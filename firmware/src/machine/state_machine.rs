//! The state machine itself; the way up from power on is in `start`, servos that are silent in `lost_servos`.

use super::command::Command;
use super::state::{Start, State};
use super::tick_output::{Action, TickOutput};
use super::watched::Watched;
use crate::collect::{collect, numbered};
use crate::fault::{Fault, FaultDetector, Feedback};
use crate::idle::{IdleLayer, IdlePose};
use crate::interpolate::{Fraction, least_jerk, lerp};
use crate::library::Library;
use crate::limits::{FINE_BITS, Limiter, Limits, clamp};
use crate::map::{GOAL_LIMIT, Idle, Joint, JointMap, Policy};
use crate::mixer::Mixer;
use crate::play_error::PlayError;
use crate::show::{After, Show};
use heapless::Vec;
use servo_wire::bus::Goal;

#[derive(Clone, Copy, Debug)]
pub(super) struct Servo {
    pub(super) limiter: Limiter,
    pub(super) limits: Limits,
    /// Where easing began, fine.
    pub(super) from: i32,
    /// Whether it was told to hold.
    pub(super) armed: bool,
    /// Whether it was read in this tick, and not in the one before.
    pub(super) back: bool,
    /// Whether it is left alone until someone acknowledges: it does not follow, or stands beyond its turn.
    pub(super) left: bool,
    /// Whether it is to let go, and has not confirmed that.
    pub(super) letting_go: bool,
    pub(super) watched: Watched,
}

impl Servo {
    /// It is where it says it is.
    pub(super) fn stand_at(&mut self, position: i32) {
        self.limiter = Limiter::at(to_goal_range(position));
        self.from = self.limiter.position();
        self.watched.forget();
    }

    /// It is neither moved nor turned on any more.
    pub(super) const fn leave(&mut self) {
        (self.armed, self.left) = (false, true);
    }

    /// A tick towards `wanted`. A servo that does not hold stays where it was last seen.
    #[inline]
    fn go(&mut self, wanted: i32) {
        if self.armed {
            self.limiter.follow(&self.limits, wanted);
        }
    }

    /// The same from outside the range: as fast as it is wanted in, not as fast as it may be.
    fn go_in(&mut self, wanted: i32) {
        if self.armed {
            self.limiter.follow_inwards(&self.limits, wanted);
        }
    }

    /// A tick of braking.
    fn brake(&mut self) {
        if self.armed {
            self.limiter.stop(&self.limits);
        }
    }
}

/// A puppet that plays clips of `L` on up to `N` servos.
pub struct Machine<'m, L: Library, const N: usize> {
    pub(super) map: &'m JointMap<N>,
    pub(super) mixer: Mixer<'m, L, N>,
    pub(super) state: State,
    pub(super) fault: Option<Fault>,
    pub(super) detector: FaultDetector<N>,
    pub(super) servos: Vec<Servo, N>,
    /// Where the joints are to go, fine, before limits.
    pub(super) wanted: Vec<i32, N>,
    pub(super) goals: Vec<Goal, N>,
    pub(super) idle: IdleLayer,
    /// Whether the idle layer has a joint to move.
    pub(super) sways: bool,
    pub(super) after: After,
    /// The servo that is looked for or turned on, and ticks since it was asked first.
    pub(super) servo: usize,
    pub(super) waited: u32,
    /// Ticks of easing, and how many there are.
    pub(super) eased: u32,
    pub(super) ease_ticks: u32,
    /// What is to be done as soon as the bus is free for it.
    pub(super) rearm: bool,
    /// Whether a servo is to let go, and has not confirmed that.
    pub(super) any_letting_go: bool,
    /// The servo that is held against its goal in the next tick.
    pub(super) watched: usize,
    /// Ticks in a row in which a servo that was turned on reads what is far from its goal.
    pub(super) doubts: u32,
    /// Whether the fault that is latched was acknowledged while the puppet still moved.
    pub(super) acknowledged: bool,
    /// Whether a servo is read that was not in the last tick.
    pub(super) any_back: bool,
    /// The last output's action.
    pub(super) asked: Option<Action>,
}

impl<'m, L: Library, const N: usize> Machine<'m, L, N> {
    /// A puppet whose power came on.
    pub fn new(map: &'m JointMap<N>, library: L, show: Show<'m>, start: Start) -> Self {
        let joints = map.joints();
        let servo = |joint: &Joint| Servo {
            limiter: Limiter::at(joint.home),
            limits: joint.limits(),
            from: 0,
            armed: false,
            back: false,
            left: false,
            letting_go: false,
            watched: Watched::new(
                joint,
                map.buses().get(usize::from(joint.bus)).map(|bus| bus.kind),
                map.settings().following_tenths,
            ),
        };
        Self {
            mixer: Mixer::new(map, library, show),
            state: State::Finding,
            fault: (start == Start::ByItself).then_some(Fault::Restarted),
            detector: FaultDetector::new(map.settings(), joints.len()),
            servos: collect(joints.iter().map(servo)),
            wanted: collect(joints.iter().map(|joint| joint.home << FINE_BITS)),
            goals: collect(joints.iter().map(|joint| Goal { id: joint.id, position: joint.home })),
            idle: IdleLayer::new(map.tick_hz(), 1),
            sways: joints.iter().any(|joint| joint.idle != Idle::default()),
            after: show.after,
            servo: 0,
            waited: 0,
            eased: 0,
            ease_ticks: 0,
            rearm: false,
            any_letting_go: false,
            watched: 0,
            doubts: 0,
            acknowledged: false,
            any_back: false,
            asked: None,
            map,
        }
    }

    /// Where the puppet is.
    pub const fn state(&self) -> State {
        match self.state {
            State::Playing if self.mixer.is_paused() => State::Paused,
            state => state,
        }
    }

    /// The fault that is latched, the first one since the last acknowledgement.
    pub const fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Where the servos were told to be, in the map's order.
    pub fn goals(&self) -> &[Goal] {
        &self.goals
    }

    /// Whether the puppet has come to an end: nothing moves, and without a command nothing will.
    pub fn at_rest(&self) -> bool {
        match self.state {
            State::Limp => true,
            State::Resting | State::LettingGo => self.is_let_go(),
            State::Holding => self.is_let_go() && (self.fault.is_some() || self.mixer.is_empty()),
            _ => false,
        }
    }

    /// What plays.
    pub const fn mixer(&self) -> &Mixer<'m, L, N> {
        &self.mixer
    }

    /// The clips.
    pub const fn library(&mut self) -> &mut L {
        self.mixer.library()
    }

    /// The map that it plays by.
    pub const fn map(&self) -> &'m JointMap<N> {
        self.map
    }

    /// Takes a command; the next ticks carry it out.
    ///
    /// # Errors
    /// Where a clip cannot be played: the puppet goes on as before.
    pub fn command(&mut self, command: Command) -> Result<(), PlayError> {
        match command {
            Command::Play { clip, repeats } => {
                self.mixer.play(clip, repeats)?;
                self.leave_rest();
            }
            Command::Queue { clip, repeats } => {
                self.mixer.queue(clip, repeats)?;
                self.leave_rest();
            }
            Command::Trigger => {
                if self.mixer.trigger()? {
                    self.leave_rest();
                }
            }
            Command::Seek { frame } => self.mixer.seek(frame)?,
            // Before its first frame a clip stands still, and while it is paused: then there is nothing to be brought together.
            Command::Sync { frame, fraction } if self.state() == State::Playing => {
                self.mixer.sync(frame, fraction)?;
            }
            Command::Sync { .. } if self.mixer.is_empty() => return Err(PlayError::Nothing),
            Command::Sync { .. } => {}
            Command::Pause => self.mixer.pause()?,
            Command::Resume => self.mixer.resume(),
            Command::Speed(speed) => self.mixer.set_speed(speed),
            Command::Stop => self.brake(After::Hold),
            Command::Home => self.brake(After::Home),
            Command::LinkLost => self.raise(Fault::LinkLost),
            Command::Acknowledge => self.acknowledge(),
        }
        Ok(())
    }

    /// The next tick.
    pub fn tick(&mut self, feedback: &Feedback<'_>) -> TickOutput<'_> {
        self.detect_faults(feedback);
        let action = match self.state {
            State::Finding => self.find(feedback),
            State::Reading => self.read(feedback),
            State::Arming => self.arm(feedback),
            State::Stopping if self.acknowledged && self.still() => {
                self.acknowledge();
                self.find(feedback)
            }
            _ => self.restore(feedback),
        };
        // In a fault nothing moves that does not have to.
        if self.fault.is_some() {
            self.idle.reset();
        }
        let idle = self.idle.tick(self.sways && self.moves_by_itself());
        self.act(idle);
        self.keep_goals_near_servos(feedback);
        self.asked = action;
        // Servos that hold are told so while the others are looked for.
        let sends = match self.state {
            State::Finding | State::Reading => self.servos.iter().any(|servo| servo.armed),
            State::Limp | State::LettingGo => false,
            // A servo was turned on, and is not where it was: first it is to say so again.
            State::Arming if self.doubts > 0 => false,
            // Where nobody is heard, nobody is told anything: a bus that comes back in mid-movement would bring servos a goal
            // that has gone on without them. They are read first, and told to go on from there.
            _ => !self.detector.all_lost(|servo| self.map.reads(servo)),
        };
        for (goal, servo) in self.goals.iter_mut().zip(&self.servos) {
            goal.position = servo.limiter.goal();
        }
        TickOutput { goals: if sends { &self.goals } else { &[] }, action }
    }

    /// Whether the idle layer is on.
    const fn moves_by_itself(&self) -> bool {
        self.fault.is_none() && matches!(self.state, State::Playing | State::Holding)
    }

    // ---- Faults

    fn detect_faults(&mut self, feedback: &Feedback<'_>) {
        self.take_back_servos(feedback);
        let (map, servos) = (self.map, &self.servos);
        let found = self.detector.detect(
            map.settings(),
            feedback,
            |index| map.reads(index),
            |index| servos.get(index).is_some_and(|servo| servo.armed),
        );
        // Before the servos are read nobody expects answers; what a servo then says of itself waits for its turn.
        match (self.state, found) {
            (State::Finding | State::Reading, _) | (_, None) => {}
            (_, Some(fault)) => self.raise(fault),
        }
        self.watch_following(feedback);
    }

    /// Latches a fault, and goes the way that the policy says.
    pub(super) fn raise(&mut self, fault: Fault) {
        if self.fault.is_some() {
            return;
        }
        self.fault = Some(fault);
        if let Fault::Clip { .. } = fault {
            self.mixer.drop_clips();
        }
        if self.map.settings().policy == Policy::TorqueOff {
            self.begin_letting_go();
        } else if !matches!(self.state, State::Finding | State::Reading) {
            self.state = State::Stopping;
        }
    }

    fn acknowledge(&mut self) {
        if self.fault.is_none() {
            return;
        }
        // While servos are looked for nobody is read, so nobody moves.
        self.acknowledged = !self.still();
        if self.acknowledged {
            self.state = State::Stopping;
            return;
        }
        self.fault = None;
        // Those that nothing reaches are not where they would have been told to be.
        if self.detector.all_lost(|servo| self.map.reads(servo)) {
            self.disarm();
        }
        self.detector = FaultDetector::new(self.map.settings(), self.map.joints().len());
        for servo in &mut self.servos {
            (servo.left, servo.letting_go) = (false, false);
            servo.watched.forget();
        }
        (self.any_letting_go, self.doubts) = (false, 0);
        self.idle.reset();
        self.enter(State::Finding);
    }

    pub(super) fn disarm(&mut self) {
        self.servos.iter_mut().for_each(|servo| servo.armed = false);
    }

    /// Holds servos that have restarted where they are, and lets go when that was decided.
    fn restore(&mut self, feedback: &Feedback<'_>) -> Option<Action> {
        let done = feedback.action == Some(Ok(()));
        match self.state {
            State::Limp => return None,
            State::LettingGo => return self.let_all_go(feedback),
            _ => {}
        }
        match self.asked {
            Some(Action::Watchdog { .. }) if done => self.rearm = false,
            Some(Action::TorqueOn { servo: index }) if done => {
                if let Some(servo) = self.servos.get_mut(index) {
                    servo.armed = true;
                }
                self.take_where_it_is(index, feedback);
                // It has forgotten its watchdog as well.
                self.rearm = true;
            }
            _ => {}
        }
        let watchdog = Action::Watchdog { millis: self.servo_watchdog_millis() };
        let readings = numbered(self.servos.iter_mut().zip(feedback.readings));
        let mut looked_at = readings.take_while(|_| self.detector.any_slack());
        let fallen = looked_at.find_map(|(index, pair)| {
            let (servo, reading) = (pair.0, (*pair.1)?);
            (reading.torque == Some(false) && reading.hardware_error == 0 && !servo.left).then(|| {
                servo.limiter = Limiter::at(to_goal_range(reading.position));
                servo.from = servo.limiter.position();
                servo.armed = false;
                Action::TorqueOn { servo: index }
            })
        });
        drop(looked_at);
        fallen
            .or(self.rearm.then_some(watchdog))
            .or_else(|| if self.any_letting_go { self.let_go(feedback) } else { None })
    }

    /// Silence after which servos stop by themselves: what the map says, but more than a tick takes, since they hear something
    /// once a tick. Where the map says less than that it is two ticks; 0 stays 0.
    pub(super) fn servo_watchdog_millis(&self) -> u16 {
        let settings = self.map.settings();
        let (millis, hz) = (settings.servo_watchdog_millis, settings.tick_hz.max(1));
        let outlasts_a_tick = u32::from(millis).saturating_mul(hz.into()) > 1000;
        if millis == 0 || outlasts_a_tick {
            millis
        } else {
            2000u16.saturating_add(hz.saturating_sub(1)).checked_div(hz).unwrap_or(millis)
        }
    }

    pub(super) fn enter(&mut self, state: State) {
        self.state = state;
        self.servo = 0;
        self.waited = 0;
        self.asked = None;
        if state == State::Limp {
            self.disarm();
        }
    }

    // ---- Movement

    /// A puppet that rests or holds gets up for a clip; one that has a fault does not.
    fn leave_rest(&mut self) {
        let waits =
            matches!(self.state, State::Holding | State::Resting | State::Returning | State::Stopping);
        self.after = self.mixer.show().after;
        if self.fault.is_none() && waits {
            self.state = State::Opening;
        }
    }

    fn brake(&mut self, after: After) {
        self.mixer.drop_clips();
        self.after = after;
        if matches!(
            self.state,
            State::Opening | State::Easing | State::Playing | State::Returning | State::Holding
        ) {
            self.state = State::Stopping;
        }
    }

    fn act(&mut self, idle: IdlePose) {
        match self.state {
            State::Limp | State::LettingGo => {}
            State::Finding | State::Reading | State::Arming => self.hold(),
            State::Opening => {
                self.hold();
                if self.still() {
                    self.open(idle);
                }
            }
            State::Easing => {
                self.mixer.pose(&mut self.wanted);
                if self.ease() {
                    self.state = State::Playing;
                }
            }
            State::Playing | State::Paused => self.play(idle),
            State::Stopping => {
                self.hold();
                if self.still() && !self.acknowledged {
                    self.stopped(idle);
                }
            }
            State::Holding => self.sway(idle),
            State::Returning => {
                if self.ease() {
                    self.state = State::Resting;
                }
            }
            State::Resting => self.hold(),
        }
    }

    /// Decodes towards the first pose; once there, begins to go to it.
    fn open(&mut self, idle: IdlePose) {
        match self.mixer.open() {
            Ok(true) if self.mixer.is_empty() => self.stopped(idle),
            Ok(true) => {
                self.mixer.pose(&mut self.wanted);
                self.begin_easing(State::Easing);
            }
            Ok(false) => {}
            Err(error) => self.raise(error),
        }
    }

    fn play(&mut self, idle: IdlePose) {
        let Self { map, mixer, servos, wanted, .. } = self;
        if mixer.pose(wanted) {
            if !idle.is_still() {
                for (joint, wanted) in map.joints().iter().zip(wanted.iter_mut()) {
                    *wanted = wanted.saturating_add(idle.offset(&joint.idle));
                }
            }
            for (servo, &mut wanted) in servos.iter_mut().zip(wanted) {
                servo.go(wanted);
            }
        } else {
            servos.iter_mut().for_each(Servo::brake);
        }
        match mixer.advance() {
            Ok(true) => {}
            Ok(false) => {
                self.state = State::Stopping;
            }
            Err(error) => self.raise(error),
        }
    }

    /// Where braking ended: what the policy says in a fault, what comes after clips otherwise.
    fn stopped(&mut self, idle: IdlePose) {
        let goes_home = match self.fault {
            None => self.after == After::Home,
            Some(Fault::Bus { .. }) => false,
            Some(_) => self.map.settings().policy == Policy::EaseHome,
        };
        if goes_home {
            for (wanted, joint) in self.wanted.iter_mut().zip(self.map.joints()) {
                *wanted = joint.home << FINE_BITS;
            }
            self.begin_easing(State::Returning);
        } else {
            for (joint, servo) in self.map.joints().iter().zip(&mut self.servos) {
                servo.from = servo.limiter.position().saturating_sub(idle.offset(&joint.idle));
            }
            self.state = State::Holding;
        }
    }

    fn still(&self) -> bool {
        self.servos.iter().all(|servo| !servo.armed || servo.limiter.velocity() == 0)
    }

    fn hold(&mut self) {
        self.servos.iter_mut().for_each(Servo::brake);
    }

    /// Holds a pose, alive.
    fn sway(&mut self, idle: IdlePose) {
        for (joint, servo) in self.map.joints().iter().zip(&mut self.servos) {
            servo.go_in(servo.from.saturating_add(idle.offset(&joint.idle)));
        }
    }

    /// Plans the way to the wanted pose: as long as the joint with the longest way needs, at least as long as the map says.
    fn begin_easing(&mut self, state: State) {
        let Self { map, servos, wanted, .. } = self;
        let settings = map.settings();
        let mut ticks = settings.ticks(settings.ease_millis).max(1);
        for (joint, (servo, to)) in map.joints().iter().zip(servos.iter_mut().zip(wanted)) {
            servo.from = servo.limiter.position();
            // What will be moved: not beyond the range, and nothing where nothing holds.
            let to = clamp(*to, servo.limits.min(), servo.limits.max());
            let way = if servo.armed { u64::from(to.abs_diff(servo.from)) } else { 0 };
            // The path's highest velocity is 15/8 of its mean, its highest acceleration 5.78 of the way over time squared.
            let share =
                u64::from(joint.max_velocity.unsigned_abs()).wrapping_mul(settings.ease_velocity.into());
            let by_velocity = way.wrapping_mul(15).div_ceil((share / 256).max(1).saturating_mul(8).max(8));
            let acceleration = u64::from(joint.max_acceleration.unsigned_abs());
            let by_acceleration =
                way.wrapping_mul(6).checked_div(acceleration).unwrap_or(0).isqrt().saturating_add(1);
            let needed = by_velocity.max(by_acceleration);
            ticks = ticks.max(u32::try_from(needed).unwrap_or(u32::MAX));
        }
        // So that a fraction of it fits.
        (self.eased, self.ease_ticks) = (0, ticks.min(100_000));
        self.state = state;
    }

    /// A tick on the way to the wanted pose; true where it is reached.
    fn ease(&mut self) -> bool {
        self.eased = self.eased.saturating_add(1);
        let last = self.eased >= self.ease_ticks;
        let path = (!last).then(|| least_jerk(Fraction::of(self.eased, self.ease_ticks)));
        for (servo, &to) in self.servos.iter_mut().zip(&self.wanted) {
            let to = clamp(to, servo.limits.min(), servo.limits.max());
            servo.go_in(path.map_or(to, |path| lerp(servo.from, to, path)));
        }
        // One that is lost is not waited for.
        let there = |(index, (servo, &to)): (usize, (&Servo, &i32))| {
            let reachable = clamp(to, servo.limits.min(), servo.limits.max());
            !servo.armed || servo.limiter.position() == reachable || self.detector.lost(index)
        };
        last && numbered(self.servos.iter().zip(&self.wanted)).all(there)
    }
}

/// A position as a servo reports it, brought to what a goal can be.
pub(super) fn to_goal_range(position: i32) -> i32 {
    clamp(position, -GOAL_LIMIT, GOAL_LIMIT)
}
