//! Outputs without a bus, for wearables: light, vibration, a figure on a display.
//!
//! A tick decodes the frames that went by, takes the last one to the outputs' units and ranges, and that is all: nothing eases,
//! nothing limits a speed, nobody answers. What may not jump, a servo above all, needs a [`Machine`](crate::machine::Machine).

use crate::clock::{Clock, Speed};
use crate::collect::collect;
use crate::demands::Demands;
use crate::frames::Frames;
use crate::limits::{FINE_BITS, clamp};
use crate::map::{Joint, JointMap};
use crate::play_error::PlayError;
use decoder_core::{Error, I16F16};
use heapless::Vec;

/// A clip that repeats on up to `N` outputs, one for each joint of a map.
#[derive(Debug)]
pub struct Wearable<'m, F, const N: usize> {
    frames: F,
    map: &'m JointMap<N>,
    clock: Clock,
    /// Frames to decode in the next tick.
    due: u32,
    levels: Vec<i32, N>,
}

impl<'m, F: Frames, const N: usize> Wearable<'m, F, N> {
    /// A wearable before its first frame, whose outputs change `hz` times a second (1 to
    /// [`MAX_TICK_HZ`](crate::clock::MAX_TICK_HZ)); the map's own rate is that of its servos.
    ///
    /// # Errors
    /// Where the clip has no rate, no frames, more frames a second than ticks can decode, or not the channels that the map follows.
    pub fn new(mut frames: F, map: &'m JointMap<N>, hz: u16) -> Result<Self, PlayError> {
        let facts = frames.facts();
        Demands { tick_hz: hz, ..map.demands() }.check(&facts)?;
        let rate = facts.rate_centihertz;
        frames.approach(0);
        let levels = collect(map.joints().iter().map(|joint| joint.home));
        Ok(Self { frames, map, clock: Clock::new(rate, hz), due: 1, levels })
    }

    /// The next tick's levels, in the order of the map's joints and within their ranges. After the last frame comes the first.
    ///
    /// Costs the decoding of the frames that went by, and four multiplies an output.
    ///
    /// # Errors
    /// What is wrong with the clip; the levels stay as they were.
    pub fn tick(&mut self) -> Result<&[i32], Error> {
        while self.due > 0 {
            self.due = self.due.saturating_sub(1);
            if self.frames.position() >= self.frames.frames() {
                self.frames.approach(0);
            }
            match self.frames.next_frame()? {
                Some(frame) if self.due == 0 => {
                    for (level, joint) in self.levels.iter_mut().zip(self.map.joints()) {
                        *level = of(joint, frame);
                    }
                }
                _ => {}
            }
        }
        self.clock.tick(Speed::NORMAL);
        while self.clock.frame_passed() {
            self.due = self.due.saturating_add(1);
        }
        Ok(&self.levels)
    }
}

/// A joint's level in a frame, which has its channel.
fn of(joint: &Joint, frame: &[I16F16]) -> i32 {
    let value = frame.get(usize::from(joint.channel)).copied().unwrap_or_default();
    let level = joint.goal(value).wrapping_add(1 << (FINE_BITS - 1)) >> FINE_BITS;
    clamp(level, joint.min, joint.max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::test_puppet::map;
    use crate::map::Settings;

    /// Frames whose one channel counts.
    struct Counting {
        next: u32,
        frame: [I16F16; 1],
    }

    impl Frames for Counting {
        fn channels(&self) -> usize {
            1
        }
        fn frames(&self) -> u32 {
            10
        }
        fn rate_centihertz(&self) -> u16 {
            12_000
        }
        fn position(&self) -> u32 {
            self.next
        }
        fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
            if self.next == 10 {
                return Ok(None);
            }
            self.frame = [I16F16::from_num(self.next)];
            self.next += 1;
            Ok(Some(&self.frame))
        }
        fn approach(&mut self, frame: u32) {
            self.next = frame;
        }
    }

    fn counting() -> Counting {
        Counting { next: 0, frame: [I16F16::ZERO] }
    }

    #[test]
    fn every_tick_has_the_frame_of_its_time_and_the_clip_repeats() {
        let three = map(Settings::new(100));
        let follows = |joint: &Joint| Joint { channel: 0, scale: I16F16::from_num(100), ..*joint };
        let joints = three.joints().iter().map(follows).collect();
        let buses = three.buses().iter().copied().collect();
        let map = JointMap::<4>::new(*three.settings(), buses, joints).unwrap();
        let mut wearable = Wearable::new(counting(), &map, 30).unwrap();
        for tick in 0..100u32 {
            let levels = wearable.tick().unwrap();
            let frame = i32::try_from(4 * tick % 10).unwrap();
            for (level, joint) in levels.iter().zip(map.joints()) {
                assert_eq!(*level, (joint.zero + 100 * frame).clamp(joint.min, joint.max), "tick {tick}");
            }
        }
    }

    #[test]
    fn a_map_of_another_clip_is_refused() {
        let map = map(Settings::new(100));
        let error = Wearable::new(counting(), &map, 30).map(|_| ()).unwrap_err();
        assert!(matches!(error, PlayError::Channel { channels: 1, .. }), "{error:?}");
    }

    #[test]
    fn a_clip_of_too_many_frames_a_tick_is_refused() {
        let map = map(Settings::new(100));
        let error = Wearable::new(counting(), &map, 7).map(|_| ()).unwrap_err();
        assert_eq!(error, PlayError::TooFast { rate_centihertz: 12_000, tick_hz: 7 });
        let sentence = error.to_string();
        assert!(
            sentence.starts_with("the clip has 120.00 frames a second, more than 16 for each of the 7"),
            "{sentence}"
        );
        assert!(!matches!(Wearable::new(counting(), &map, 8), Err(PlayError::TooFast { .. })));
    }
}
