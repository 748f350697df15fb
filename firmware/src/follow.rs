//! Follows goals that somebody sends live, as the Blender Servo Animation add-on does ([`blender`](servo_wire::blender)).
//!
//! What comes is the pose of a clip without an end, one frame a tick, on a map on which each joint follows its own goal
//! ([`goal_map`]). So all that holds for clips holds here: servos are found, turned on where they are, and eased to the first pose; range,
//! velocity and acceleration are limited behind whatever comes.

use crate::collect::{collect, numbered};
use crate::frames::Frames;
use crate::map::{Joint, JointMap, MapError};
use core::cell::RefCell;
use decoder_core::{Error, I16F16};
use heapless::Vec;
use servo_wire::blender::{FRAME_LEN, Parser};

/// The map on which joint `n` follows channel `n`, whose values are goals counted from the joint's `zero`.
///
/// # Errors
/// None that a map does not have already.
pub fn goal_map<const N: usize>(map: &JointMap<N>) -> Result<JointMap<N>, MapError> {
    let joints = numbered(map.joints());
    let joints =
        joints.map(|(channel, joint)| Joint { channel: channel as u16, scale: I16F16::ONE, ..*joint });
    JointMap::new(*map.settings(), collect(map.buses().iter().copied()), collect(joints))
}

/// What has come so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames for servos of the puppet.
    pub frames: u32,
    /// Frames for others, which are ignored.
    pub foreign: u32,
    /// Bytes, whether of frames or not.
    pub bytes: u32,
}

impl Counters {
    /// Bytes that are of no frame. Up to four of them may begin one that is still to come.
    pub const fn skipped(&self) -> u32 {
        let frames = self.frames.saturating_add(self.foreign);
        self.bytes.saturating_sub(frames.saturating_mul(FRAME_LEN as u32))
    }
}

#[derive(Debug)]
struct State<const N: usize> {
    parser: Parser,
    /// Goals, counted from zero.
    pose: Vec<I16F16, N>,
    counters: Counters,
    /// Ticks since the last frame.
    silent: u32,
    lost: bool,
}

/// Takes live frames, and gives them to a player. `N`: most servos.
#[derive(Debug)]
pub struct Follow<'m, const N: usize> {
    map: &'m JointMap<N>,
    /// Ticks of silence after which the one who sends is gone; 0: never.
    patience: u32,
    /// Nothing here borrows it twice; but a panic would be worse than a frame that is left out.
    state: RefCell<State<N>>,
}

impl<'m, const N: usize> Follow<'m, N> {
    /// Before the first frame. `map` is that of the player, from [`goal_map`]. `lost_millis`: see [`tick`](Self::tick).
    pub fn new(map: &'m JointMap<N>, lost_millis: u16) -> Self {
        let pose = collect(map.joints().iter().map(|joint| value(joint, joint.home)));
        let state =
            State { parser: Parser::new(), pose, counters: Counters::default(), silent: 0, lost: false };
        Self { map, patience: map.settings().ticks(lost_millis), state: RefCell::new(state) }
    }

    /// Takes bytes of the line, cut as they come. A frame goes to every servo that has its id. What is no frame is skipped; there is
    /// no checksum, so noise may be taken for a frame, which limits make harmless.
    pub fn feed(&self, bytes: &[u8]) {
        let Ok(mut state) = self.state.try_borrow_mut() else { return };
        let State { parser, pose, counters, silent, .. } = &mut *state;
        counters.bytes = counters.bytes.saturating_add(bytes.len() as u32);
        for goal in bytes.iter().filter_map(|&byte| parser.feed(byte)) {
            let mut known = false;
            for (joint, slot) in self.map.joints().iter().zip(pose.iter_mut()) {
                if joint.id == goal.id {
                    *slot = value(joint, goal.position);
                    known = true;
                }
            }
            let counter = if known { &mut counters.frames } else { &mut counters.foreign };
            *counter = counter.saturating_add(1);
            if known {
                *silent = 0;
            }
        }
    }

    /// A tick goes by. True once: in the tick in which there has been no frame for `lost_millis`, and there was one before; the
    /// player is then to be told [`Command::LinkLost`](crate::machine::Command::LinkLost).
    pub fn tick(&self) -> bool {
        let Ok(mut state) = self.state.try_borrow_mut() else { return false };
        let State { counters, silent, lost, .. } = &mut *state;
        if counters.frames == 0 || self.patience == 0 || *lost {
            return false;
        }
        *silent = silent.saturating_add(1);
        *lost = *silent > self.patience;
        *lost
    }

    /// What has come so far.
    pub fn counters(&self) -> Counters {
        self.state.try_borrow().map(|state| state.counters).unwrap_or_default()
    }

    /// The pose as a clip without an end. It begins with the first frame that comes; joints of which none has come are at home.
    pub fn frames(&self) -> Poses<'_, 'm, N> {
        Poses { follow: self, position: 0, pose: Vec::new() }
    }
}

/// A goal within a joint's range, counted from its zero.
fn value(joint: &Joint, goal: i32) -> I16F16 {
    I16F16::saturating_from_num(goal.min(joint.max).max(joint.min).saturating_sub(joint.zero))
}

/// What [`Follow::frames`] gives.
#[derive(Debug)]
pub struct Poses<'f, 'm, const N: usize> {
    follow: &'f Follow<'m, N>,
    position: u32,
    pose: Vec<I16F16, N>,
}

impl<const N: usize> Frames for Poses<'_, '_, N> {
    fn channels(&self) -> usize {
        self.follow.map.joints().len()
    }

    fn frames(&self) -> u32 {
        u32::MAX
    }

    /// One a tick, as far as can be said.
    fn rate_centihertz(&self) -> u16 {
        self.follow.map.tick_hz().saturating_mul(100)
    }

    fn position(&self) -> u32 {
        self.position
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        let Ok(state) = self.follow.state.try_borrow() else { return Ok(None) };
        if state.counters.frames == 0 {
            return Ok(None);
        }
        self.pose.clone_from(&state.pose);
        // Short of the end, which never comes.
        self.position = self.position.saturating_add(1).min(u32::MAX / 2);
        Ok(Some(&self.pose))
    }

    /// There is no way back.
    fn approach(&mut self, _: u32) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decoder_list::SingleClip;
    use crate::fault::{Fault, Feedback};
    use crate::machine::{Action, Command, Machine, Show, Start, State};
    use crate::map::{BusKind, BusSpec, Idle, Settings};
    use servo_wire::blender::frame;
    use servo_wire::bus::{Goal, Reading};

    const SPEED: i32 = 30 << 10;
    const ACCELERATION: i32 = 3 << 10;

    fn map() -> JointMap<4> {
        let joint = |id: u8, zero: i32| Joint {
            channel: 77,
            bus: 0,
            id,
            zero,
            home: zero,
            scale: I16F16::lit("-11.378"),
            min: zero - 800,
            max: zero + 1000,
            max_velocity: SPEED,
            max_acceleration: ACCELERATION,
            idle: Idle::default(),
        };
        let bus = BusSpec { kind: BusKind::Dynamixel, baud: 1_000_000 };
        let joints = [joint(3, 2000), joint(9, 1000)].into_iter().collect();
        goal_map(&JointMap::new(Settings::new(100), [bus].into_iter().collect(), joints).unwrap()).unwrap()
    }

    fn send(follow: &Follow<'_, 4>, id: u8, position: i32) {
        follow.feed(&frame(&Goal { id, position }));
    }

    /// A puppet whose servos are where they are told to be, tick by tick: what it was told, where it was in the end, and its fault.
    fn play(
        map: &JointMap<4>,
        follow: &Follow<'_, 4>,
        ticks: u32,
        mut input: impl FnMut(u32, State, &Follow<'_, 4>),
    ) -> (std::vec::Vec<[i32; 2]>, State, Option<Fault>) {
        let show = Show { playlist: &[0], ..Show::default() };
        let mut machine = Machine::new(map, SingleClip::<_>::new(follow.frames(), None), show, Start::Power);
        let mut readings = [2000, 1000].map(|position| Reading {
            position,
            temperature: None,
            millivolts: None,
            load: None,
            hardware_error: 0,
            torque: Some(false),
        });
        let (mut told, mut acted) = (std::vec::Vec::new(), None);
        for tick in 0..ticks {
            input(tick, machine.state(), follow);
            if follow.tick() {
                machine.command(Command::LinkLost).unwrap();
            }
            let shown = readings.map(Some);
            let feedback = Feedback { readings: &shown, bus: Ok(()), action: acted, late: false };
            let plan = machine.tick(&feedback);
            acted = plan.action.map(|_| Ok(()));
            if let Some(Action::TorqueOn { servo }) = plan.action {
                readings[servo].torque = Some(true);
            }
            if let [first, second] = plan.goals {
                told.push([first.position, second.position]);
                (readings[0].position, readings[1].position) = (first.position, second.position);
            }
        }
        (told, machine.state(), machine.fault())
    }

    /// Whether no servo left its range, or moved faster than it may, or with more acceleration.
    fn smooth(told: &[[i32; 2]]) {
        for servo in 0..2 {
            let zero = [2000, 1000][servo];
            let at: std::vec::Vec<i32> = told.iter().map(|goals| goals[servo]).collect();
            assert!(at.iter().all(|goal| (zero - 800..=zero + 1000).contains(goal)));
            for three in at.windows(3) {
                let (before, after) = (three[1] - three[0], three[2] - three[1]);
                // Whole units of what is 1/1024 fine.
                assert!(after.abs() <= (SPEED >> 10) + 1, "{three:?}");
                assert!((after - before).abs() <= (ACCELERATION >> 10) + 2, "{three:?}");
            }
        }
    }

    #[test]
    fn it_waits_for_the_first_frame_and_eases_to_it() {
        let map = map();
        let follow = Follow::new(&map, 500);
        let (told, state, _) = play(&map, &follow, 300, |_, _, follow| send(follow, 8, 1500));
        assert_eq!(
            (state, follow.counters()),
            (State::Opening, Counters { frames: 0, foreign: 300, bytes: 1500 })
        );
        assert!(told.iter().all(|goals| *goals == [2000, 1000]));
        follow.feed(b"<<\x01>noise");
        assert_eq!(follow.counters().skipped(), 9);
        let (told, state, fault) = play(&map, &follow, 500, |_, _, follow| send(follow, 3, 2900));
        assert_eq!((state, fault), (State::Playing, None));
        smooth(&told);
        assert_eq!(told.last(), Some(&[2900, 1000]));
    }

    #[test]
    fn what_jumps_goes_smoothly_and_what_is_out_of_range_stays_in_it() {
        let map = map();
        let follow = Follow::new(&map, 500);
        let (told, state, _) = play(&map, &follow, 1000, |tick, _, follow| {
            let far = tick / 100 % 2 == 0;
            send(follow, 3, if far { 65_535 } else { 0 });
            send(follow, 9, if far { 500 } else { 1500 });
        });
        assert_eq!(state, State::Playing);
        smooth(&told);
        for (servo, (least, most)) in [(1200, 3000), (500, 1500)].into_iter().enumerate() {
            let at = told.iter().map(|goals| goals[servo]);
            assert_eq!((at.clone().min(), at.max()), (Some(least), Some(most)));
        }
    }

    #[test]
    fn silence_is_a_lost_link_and_the_pose_is_held() {
        let map = map();
        for (lost_millis, expected) in [(500, Some(Fault::LinkLost)), (0, None)] {
            let follow = Follow::new(&map, lost_millis);
            let mut spoke = 0;
            let (told, state, fault) = play(&map, &follow, 900, |tick, _, follow| {
                if tick < 500 {
                    spoke = tick;
                    send(follow, 3, 2000 + tick as i32);
                }
            });
            assert_eq!(fault, expected);
            assert_eq!(state, if expected.is_some() { State::Holding } else { State::Playing });
            smooth(&told);
            let held = told[told.len() - 100];
            assert!(told[told.len() - 100..].iter().all(|goals| *goals == held), "{held:?}");
            assert_eq!(held, [2000 + spoke as i32, 1000]);
        }
    }

    #[test]
    fn noise_moves_nothing_faster_than_it_may() {
        let map = map();
        let mut rng = fastrand::Rng::with_seed(7);
        let mut random = move || rng.u8(..);
        let follow = Follow::new(&map, 500);
        let (told, state, fault) = play(&map, &follow, 3000, |tick, _, follow| {
            // Frames among bytes that look like frames often, cut anywhere.
            for _ in 0..40 {
                let bytes = [b'<', 3, 9, 0xFF, b'>', random()];
                follow.feed(&[bytes[usize::from(random()) % bytes.len()]]);
            }
            send(follow, 3, 2000 + (tick as i32 / 4) % 500);
        });
        assert_eq!((state, fault), (State::Playing, None));
        assert!(follow.counters().frames > 2000, "{:?}", follow.counters());
        smooth(&told);
        assert!(told.iter().any(|goals| goals[1] != 1000), "the noise never looked like a frame");
    }
}
