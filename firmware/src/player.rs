//! Plays frames on servos: one set of goals a tick.
//!
//! A tick takes the two frames around its time, interpolates the channels that the map names, scales them to goal
//! units, and applies each servo's limits. All in 32-bit integers, and with one divide a tick, so it gives the
//! same goals on every machine.

use crate::clock::Clock;
use crate::dynamixel::Goal;
use crate::interpolate::lerp;
use crate::map::JointMap;
use core::fmt;
use decoder_core::{I16F16, mclip, qmd};
use heapless::Vec;

/// Where frames come from, in order.
///
/// A frame has one value a channel. Angles are taken to be continuous from frame to frame (the encoder unwraps
/// them): interpolation does not know that 360° is 0°.
pub trait Frames {
    /// Values in a frame.
    fn channels(&self) -> usize;

    /// The next frame; `None` after the last one.
    fn next_frame(&mut self) -> Option<&[I16F16]>;

    /// Goes back to before the first frame.
    fn rewind(&mut self);
}

impl<F: Frames + ?Sized> Frames for &mut F {
    fn channels(&self) -> usize {
        (**self).channels()
    }

    fn next_frame(&mut self) -> Option<&[I16F16]> {
        (**self).next_frame()
    }

    fn rewind(&mut self) {
        (**self).rewind();
    }
}

impl Frames for qmd::Decoder<'_, '_> {
    fn channels(&self) -> usize {
        self.clip().channels()
    }

    fn next_frame(&mut self) -> Option<&[I16F16]> {
        self.next_frame()
    }

    fn rewind(&mut self) {
        self.rewind();
    }
}

/// A block that is damaged ends the clip: the servos hold its last frame.
impl Frames for mclip::Decoder<'_, '_> {
    fn channels(&self) -> usize {
        self.clip().channels()
    }

    fn next_frame(&mut self) -> Option<&[I16F16]> {
        self.next_frame().ok().flatten()
    }

    fn rewind(&mut self) {
        self.rewind();
    }
}

/// What comes after the last frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Repeat {
    /// Nothing: the player ends.
    Once,
    /// The first frame, one frame's time after the last one, for as long as the player is not stopped.
    Forever,
}

/// Plays frames by a joint map, tick by tick.
///
/// Tick `k` is at time `k / tick_hz`, and frame `i` at time `i / rate`. [`Repeat::Once`] takes
/// `⌈(frames − 1) · tick_hz / rate⌉ + 1` ticks, the last of which is at the last frame.
///
/// Before the first tick every servo counts as being at its zero, so a clip that begins elsewhere is approached at
/// the speed limit.
#[derive(Debug)]
pub struct Player<'m, F, const N: usize> {
    frames: F,
    map: &'m JointMap<N>,
    clock: Clock,
    repeat: Repeat,
    state: State,
    /// For every joint its channel in the frame before the tick and in the one after it.
    spans: Vec<Span, N>,
    goals: Vec<Goal, N>,
}

#[derive(Clone, Copy, Debug)]
struct Span {
    from: I16F16,
    to: I16F16,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Playing,
    /// The next tick is the last one.
    AtLastFrame,
    Ended,
}

impl<'m, F: Frames, const N: usize> Player<'m, F, N> {
    /// A player before tick 0, which is at the first frame. `rate_centihertz` is the clip's rate in hundredths of
    /// a frame per second.
    ///
    /// # Errors
    /// [`PlayError`] where frames, rate and map do not fit together.
    pub fn new(
        mut frames: F,
        rate_centihertz: u16,
        map: &'m JointMap<N>,
        repeat: Repeat,
    ) -> Result<Self, PlayError> {
        if rate_centihertz == 0 {
            return Err(PlayError::Rate);
        }
        let channels = frames.channels();
        for joint in map.joints() {
            if usize::from(joint.channel) >= channels {
                return Err(PlayError::Channel { id: joint.id, channel: joint.channel, channels });
            }
        }
        frames.rewind();
        let first = frames.next_frame().ok_or(PlayError::NoFrames)?;
        let value = |channel: u16| first.get(usize::from(channel)).copied().unwrap_or_default();
        let joints = map.joints().iter();
        let spans = joints.clone().map(|joint| Span { from: value(joint.channel), to: value(joint.channel) });
        let goals = joints.map(|joint| Goal { id: joint.id, position: joint.zero });
        let mut player = Self {
            spans: spans.collect(),
            goals: goals.collect(),
            clock: Clock::new(rate_centihertz, map.tick_hz()),
            frames,
            map,
            repeat,
            state: State::Playing,
        };
        player.step();
        Ok(player)
    }

    /// The goals of the next tick, one a joint in the map's order; `None` once the clip has ended or was stopped.
    ///
    /// Decodes the frames that went by since the tick before.
    pub fn tick(&mut self) -> Option<&[Goal]> {
        match self.state {
            State::Ended => return None,
            State::AtLastFrame | State::Playing => self.set_goals(),
        }
        if self.state == State::AtLastFrame {
            self.state = State::Ended;
        }
        self.advance();
        Some(&self.goals)
    }

    /// Ends: no further tick has goals, so the servos hold the last ones.
    pub fn stop(&mut self) {
        self.state = State::Ended;
    }

    /// The map that it plays by.
    pub const fn map(&self) -> &'m JointMap<N> {
        self.map
    }

    fn set_goals(&mut self) {
        let fraction = self.clock.fraction();
        for ((joint, span), goal) in self.map.joints().iter().zip(&self.spans).zip(&mut self.goals) {
            let value = I16F16::from_bits(lerp(span.from.to_bits(), span.to.to_bits(), fraction));
            goal.position = joint.limits().apply(joint.goal(value), goal.position);
        }
    }

    /// Goes on to the next tick's time.
    fn advance(&mut self) {
        self.clock.tick();
        while self.state == State::Playing && self.clock.frame_passed() {
            self.step();
        }
        if self.state == State::AtLastFrame {
            self.clock.align();
        }
    }

    /// Makes the frame after the tick the one before it, and decodes another one.
    fn step(&mut self) {
        for span in &mut self.spans {
            span.from = span.to;
        }
        let mut next = self.frames.next_frame();
        if next.is_none() && self.repeat == Repeat::Forever {
            self.frames.rewind();
            next = self.frames.next_frame();
        }
        match next {
            Some(frame) => {
                for (joint, span) in self.map.joints().iter().zip(&mut self.spans) {
                    span.to = frame.get(usize::from(joint.channel)).copied().unwrap_or(span.to);
                }
            }
            None => self.state = State::AtLastFrame,
        }
    }
}

/// Why a clip cannot be played by a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum PlayError {
    /// The clip does not say its rate.
    Rate,
    /// There is no frame to play.
    NoFrames,
    /// A joint follows a channel that the clip does not have.
    Channel {
        /// The servo.
        id: u8,
        /// The channel.
        channel: u16,
        /// Channels of the clip.
        channels: usize,
    },
}

impl fmt::Display for PlayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Rate => f.write_str("the clip does not say its frame rate"),
            Self::NoFrames => f.write_str("the clip has no frames"),
            Self::Channel { id, channel, channels } => {
                write!(
                    f,
                    "servo {id} follows channel {channel} (from 0), but the clip has {channels} channels"
                )
            }
        }
    }
}

impl core::error::Error for PlayError {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{GOAL_LIMIT, Joint};
    use proptest::prelude::*;

    /// Frames in memory, without a codec.
    struct Table {
        frames: std::vec::Vec<std::vec::Vec<I16F16>>,
        next: usize,
    }

    impl Frames for Table {
        fn channels(&self) -> usize {
            self.frames.first().map_or(0, |frame| frame.len())
        }

        fn next_frame(&mut self) -> Option<&[I16F16]> {
            let frame = self.frames.get(self.next)?;
            self.next += 1;
            Some(frame)
        }

        fn rewind(&mut self) {
            self.next = 0;
        }
    }

    fn table(values: &[i32]) -> Table {
        Table { frames: values.iter().map(|&value| vec![I16F16::from_num(value)]).collect(), next: 0 }
    }

    /// One goal unit a degree, and no limits to speak of.
    const PLAIN: Joint = Joint {
        channel: 0,
        id: 1,
        zero: 0,
        scale: I16F16::ONE,
        min: -100_000,
        max: 100_000,
        max_step: GOAL_LIMIT,
    };

    fn map(tick_hz: u16, joints: &[Joint]) -> JointMap<8> {
        JointMap::new(tick_hz, 1_000_000, joints.iter().copied().collect()).unwrap()
    }

    fn positions(player: &mut Player<'_, Table, 8>) -> std::vec::Vec<i32> {
        std::iter::from_fn(|| player.tick().map(|goals| goals[0].position)).collect()
    }

    #[test]
    fn frames_are_interpolated_and_the_last_one_is_reached() {
        let map = map(100, &[PLAIN]);
        let mut half = Player::new(table(&[0, 100, 40]), 5_000, &map, Repeat::Once).unwrap();
        assert_eq!(positions(&mut half), [0, 50, 100, 70, 40]);
        // 150 fps: ticks at frames 0, 1.5 and, past the end, 2.
        let mut skipping = Player::new(table(&[0, 100, 40]), 15_000, &map, Repeat::Once).unwrap();
        assert_eq!(positions(&mut skipping), [0, 70, 40]);
        let mut single = Player::new(table(&[7]), 12_000, &map, Repeat::Once).unwrap();
        assert_eq!(positions(&mut single), [7]);
    }

    #[test]
    fn a_repeated_clip_closes_over_one_frame() {
        let map = map(100, &[PLAIN]);
        let mut player = Player::new(table(&[0, 100]), 5_000, &map, Repeat::Forever).unwrap();
        let goals: std::vec::Vec<_> = (0..9).map(|_| player.tick().unwrap()[0].position).collect();
        assert_eq!(goals, [0, 50, 100, 50, 0, 50, 100, 50, 0]);
        player.stop();
        assert_eq!(player.tick(), None);
        let mut still = Player::new(table(&[5]), 5_000, &map, Repeat::Forever).unwrap();
        assert!((0..1000).all(|_| still.tick().is_some_and(|goals| goals[0].position == 5)));
    }

    #[test]
    fn the_first_goal_is_a_step_from_zero() {
        let joint = Joint { zero: 10, max_step: 4, ..PLAIN };
        let map = map(100, &[joint]);
        let mut player = Player::new(table(&[90; 40]), 10_000, &map, Repeat::Once).unwrap();
        assert_eq!(positions(&mut player)[..3], [14, 18, 22]);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let map = map(100, &[Joint { channel: 1, id: 9, ..PLAIN }]);
        let new = |frames, rate| Player::new(frames, rate, &map, Repeat::Once).err();
        assert_eq!(new(table(&[1]), 100), Some(PlayError::Channel { id: 9, channel: 1, channels: 1 }));
        assert_eq!(new(table(&[1]), 0), Some(PlayError::Rate));
        let empty = Player::new(table(&[]), 100, &map, Repeat::Once).err();
        assert_eq!(empty, Some(PlayError::Channel { id: 9, channel: 1, channels: 0 }));
    }

    #[test]
    fn a_million_ticks_take_the_time_that_they_should() {
        // 1e6 ticks at 50 Hz are 20,000 s: 599,400 frames of 29.97 Hz.
        let map = map(50, &[PLAIN]);
        let frames = 599_401;
        let values: std::vec::Vec<_> = (0..frames).map(|frame| frame % 1000).collect();
        let mut player = Player::new(table(&values), 2_997, &map, Repeat::Once).unwrap();
        assert_eq!(positions(&mut player).len(), 1_000_001);
    }

    /// The goals by wide arithmetic, from the definition.
    fn slow_goals(frames: &[std::vec::Vec<I16F16>], rate: u16, map: &JointMap<8>) -> std::vec::Vec<Goal> {
        let (rate, tick_rate) = (i128::from(rate), i128::from(map.tick_hz()) * 100);
        let last_frame = frames.len() as i128 - 1;
        let ticks = (last_frame * tick_rate + rate - 1).div_euclid(rate) + 1;
        let mut goals = std::vec::Vec::new();
        let mut sent: std::vec::Vec<i128> = map.joints().iter().map(|joint| i128::from(joint.zero)).collect();
        for tick in 0..ticks {
            let parts = (tick * rate).min(last_frame * tick_rate);
            let (frame, phase) = (parts / tick_rate, parts % tick_rate);
            let fraction = phase * 32_768 / tick_rate;
            for (joint, sent) in map.joints().iter().zip(&mut sent) {
                let value = |frame: i128| {
                    i128::from(frames[frame.min(last_frame) as usize][usize::from(joint.channel)].to_bits())
                };
                let value = value(frame) + ((value(frame + 1) - value(frame)) * fraction).div_euclid(32_768);
                let product = value * i128::from(joint.scale.to_bits());
                let goal = i128::from(joint.zero) + (product + (1 << 31)).div_euclid(1 << 32);
                let limited = goal.clamp(i128::from(joint.min), i128::from(joint.max));
                let step = i128::from(joint.max_step);
                *sent = limited.clamp(*sent - step, *sent + step);
                goals.push(Goal { id: joint.id, position: *sent as i32 });
            }
        }
        goals
    }

    prop_compose! {
        fn any_joint(channels: u16)(
            channel in 0..channels,
            id in 0u8..=252,
            mut range in [-GOAL_LIMIT..=GOAL_LIMIT, -GOAL_LIMIT..=GOAL_LIMIT, -GOAL_LIMIT..=GOAL_LIMIT],
            narrow in 0u32..20,
            scale in any::<i32>().prop_filter("a scale", |&scale| scale != 0),
            max_step in prop_oneof![1..=GOAL_LIMIT, 1..100],
        ) -> Joint {
            range.sort_unstable();
            let [min, zero, max] = range.map(|end| end >> narrow);
            Joint { channel, id, zero, scale: I16F16::from_bits(scale), min, max, max_step }
        }
    }

    prop_compose! {
        fn any_play()(channels in 1u16..6)(
            frames in prop::collection::vec(
                prop::collection::vec(any::<i32>().prop_map(I16F16::from_bits), usize::from(channels)),
                1..30,
            ),
            joints in prop::collection::vec(any_joint(channels), 1..8),
            rate in 1_000u16..,
            tick_hz in 1u16..=1000,
        ) -> (std::vec::Vec<std::vec::Vec<I16F16>>, JointMap<8>, u16) {
            let mut unique: Vec<Joint, 8> = Vec::new();
            for joint in joints {
                if unique.iter().all(|other| other.id != joint.id) {
                    unique.push(joint).unwrap();
                }
            }
            (frames, JointMap::new(tick_hz, 57_600, unique).unwrap(), rate)
        }
    }

    proptest! {
        #[test]
        fn any_clip_on_any_map_plays_as_defined((frames, map, rate) in any_play()) {
            let expected = slow_goals(&frames, rate, &map);
            let mut player = Player::new(Table { frames, next: 0 }, rate, &map, Repeat::Once).unwrap();
            let mut goals = std::vec::Vec::new();
            while let Some(tick) = player.tick() {
                goals.extend_from_slice(tick);
            }
            prop_assert_eq!(goals, expected);
        }

        #[test]
        fn no_goal_breaks_a_limit((frames, map, rate) in any_play(), repeat: bool) {
            let repeat = if repeat { Repeat::Forever } else { Repeat::Once };
            let mut player = Player::new(Table { frames, next: 0 }, rate, &map, repeat).unwrap();
            let mut sent: std::vec::Vec<_> = map.joints().iter().map(|joint| joint.zero).collect();
            for _ in 0..500 {
                let Some(goals) = player.tick() else { break };
                for ((joint, sent), goal) in map.joints().iter().zip(&mut sent).zip(goals) {
                    prop_assert_eq!(goal.id, joint.id);
                    prop_assert!((joint.min..=joint.max).contains(&goal.position));
                    let step = i64::from(goal.position) - i64::from(*sent);
                    prop_assert!(step.abs() <= i64::from(joint.max_step));
                    *sent = goal.position;
                }
            }
        }
    }
}
