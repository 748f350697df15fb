//! A clip that plays: frames out of a decoder, in time, interpolated to the tick.

use crate::clock::{Clock, Speed};
use crate::collect::collect;
use crate::frames::Frames;
use crate::interpolate::{Fraction, catmull_rom, lerp};
use crate::map::{Interpolation, JointMap};
use crate::play_error::PlayError;
use decoder_core::Error;
use heapless::Vec;

/// A clip and where it is. Tick `k` is at time `k / tick_hz`, and frame `i` at time `i / rate`.
#[derive(Debug)]
pub struct Playback<F, const N: usize> {
    frames: F,
    clock: Clock,
    /// How far the tick is from that frame to the next one: a divide, for all joints.
    fraction: Fraction,
    /// Number of the frame before the tick.
    frame: u32,
    /// Whether the first frame comes after the last one.
    repeats: bool,
    /// Frames that `taps` repeats the last one for: with 2 the playback is at the last frame.
    beyond: u8,
    /// For every joint its goal, fine, in the frame before the one before the tick, and in those after.
    taps: Vec<[i32; 4], N>,
    /// Frame that is still to be reached.
    seek: Option<u32>,
}

/// Frames that a playback decodes in a tick at most to get to where it shall start.
pub const SEEK_FRAMES: u32 = 8;

impl<F: Frames, const N: usize> Playback<F, N> {
    /// A playback before frame `start`, or the last one if there are not so many. It starts there after
    /// [`seek`](Self::seek) returned true.
    ///
    /// # Errors
    /// [`PlayError`] where the clip does not fit the map, with the frames.
    pub fn new(mut frames: F, map: &JointMap<N>, repeats: bool, start: u32) -> Result<Self, (PlayError, F)> {
        let facts = frames.facts();
        if let Err(error) = map.demands().check(&facts) {
            return Err((error, frames));
        }
        let last = facts.frames.saturating_sub(1);
        let start = start.min(last);
        // The curve at a frame depends on the one before it.
        frames.approach(start.saturating_sub(1));
        Ok(Self {
            clock: Clock::new(frames.rate_centihertz(), map.tick_hz()),
            fraction: Fraction::START,
            frame: start,
            repeats,
            beyond: 0,
            taps: collect(map.joints().iter().map(|_| [0; 4])),
            seek: Some(start),
            frames,
        })
    }

    /// Decodes up to [`SEEK_FRAMES`] frames towards the start, and says whether it is reached.
    ///
    /// # Errors
    /// What is wrong with the clip.
    pub fn seek(&mut self, map: &JointMap<N>) -> Result<bool, Error> {
        let Some(start) = self.seek else { return Ok(true) };
        for _ in 0..SEEK_FRAMES {
            if self.frames.position() > start {
                // The frame before the tick stands last, and the two after it are to come.
                if start == 0 {
                    self.fill_first();
                }
                self.seek = None;
                self.shift(map)?;
                self.shift(map)?;
                return Ok(true);
            }
            self.pull(map)?;
        }
        Ok(false)
    }

    /// Before the first frame there is that frame again.
    fn fill_first(&mut self) {
        for taps in &mut self.taps {
            *taps = [taps[3]; 4];
        }
    }

    /// Gives `put` where the clip wants each joint at the tick, in 1/1024 goal units within ±2³⁰, with that joint's place in
    /// `wanted`.
    #[inline]
    pub fn pose(&self, interpolation: Interpolation, wanted: &mut [i32], put: impl Fn(&mut i32, i32)) {
        let (fraction, joints) = (self.fraction, self.taps.iter().zip(wanted));
        // One loop each: what is decided here is the same for all joints.
        match interpolation {
            _ if fraction == Fraction::START => joints.for_each(|(taps, wanted)| put(wanted, taps[1])),
            Interpolation::Linear => {
                joints.for_each(|(taps, wanted)| put(wanted, lerp(taps[1], taps[2], fraction)));
            }
            Interpolation::CatmullRom => {
                joints.for_each(|(taps, wanted)| put(wanted, catmull_rom(*taps, fraction)));
            }
        }
    }

    /// Goes on by a tick. At the last frame it stays there.
    ///
    /// # Errors
    /// What is wrong with the clip.
    pub fn advance(&mut self, map: &JointMap<N>, speed: Speed) -> Result<(), Error> {
        if self.ended() {
            return Ok(());
        }
        self.clock.tick(speed);
        while !self.ended() && self.clock.frame_passed() {
            self.shift(map)?;
            self.frame = if self.frame >= self.last() { 0 } else { self.frame.wrapping_add(1) };
        }
        if self.ended() {
            self.clock.align();
        }
        self.fraction = self.clock.fraction();
        Ok(())
    }

    /// Whether it is at the last frame of a clip that does not repeat.
    pub const fn ended(&self) -> bool {
        self.beyond >= 2
    }

    /// Frames from the tick to the last one; of a clip that repeats, more than there are.
    pub fn left(&self) -> u32 {
        if self.repeats { u32::MAX } else { self.last().saturating_sub(self.frame) }
    }

    /// Lets a clip that repeats end after its last frame.
    pub const fn end(&mut self) {
        self.repeats = false;
    }

    /// Number of the frame before the tick, and how far the tick is from it in 1/65536 of a frame.
    pub const fn position(&self) -> (u32, u16) {
        (self.frame, self.clock.phase())
    }

    /// Works off the distance to an outside clock that is at this frame; see [`Clock::follow`].
    pub fn follow(&mut self, frame: u32, fraction: u16) -> bool {
        let (at, phase) = self.position();
        let ahead = (i64::from(frame) << 16 | i64::from(fraction))
            .wrapping_sub(i64::from(at) << 16 | i64::from(phase));
        i32::try_from(ahead >> 16).is_ok_and(|frames| self.clock.follow(frames, ahead as u16))
    }

    /// Frames per second of the clip, in hundredths.
    pub fn rate_centihertz(&self) -> u16 {
        self.frames.rate_centihertz()
    }

    /// Moves the start, before it is reached, to where an outside clock is, in 1/65536 of a frame.
    pub fn aim(&mut self, at: u64) {
        let frames = u64::from(self.frames.frames()).max(1);
        let last = frames.saturating_sub(1);
        let whole =
            if self.repeats { (at >> 16).checked_rem(frames).unwrap_or(0) } else { (at >> 16).min(last) };
        let Some(start) = self.seek else { return };
        let aimed = whole as u32;
        if aimed < start {
            self.frames.approach(aimed.saturating_sub(1));
        }
        (self.seek, self.frame) = (Some(aimed), aimed);
        // The last frame of a clip that ends is its end: there is no part of a next one.
        self.clock.set_phase(if whole == last && !self.repeats { 0 } else { at as u16 });
        self.fraction = self.clock.fraction();
    }

    /// Frames that go by in a tick, in 1/65536.
    pub fn stride(&self, map: &JointMap<N>, speed: Speed) -> u64 {
        let parts = u64::from(self.rate_centihertz()).saturating_mul(speed.parts().into()) << 16;
        parts.checked_div(u64::from(map.tick_hz()).saturating_mul(100 * 256)).unwrap_or(0)
    }

    /// Frames of the clip.
    pub fn frames(&self) -> u32 {
        self.frames.frames()
    }

    /// Gives the decoder back.
    pub fn into_frames(self) -> F {
        self.frames
    }

    fn last(&self) -> u32 {
        self.frames.frames().saturating_sub(1)
    }

    /// Makes the frame after the tick the one before it, and decodes another one.
    fn shift(&mut self, map: &JointMap<N>) -> Result<(), Error> {
        if self.frames.position() > self.last() && self.repeats {
            self.frames.approach(0);
        }
        if !self.pull(map)? {
            self.beyond = self.beyond.saturating_add(1);
        }
        Ok(())
    }

    /// Takes a frame in; false, and the last one again, where there is none.
    fn pull(&mut self, map: &JointMap<N>) -> Result<bool, Error> {
        let frame = self.frames.next_frame()?;
        for (joint, taps) in map.joints().iter().zip(&mut self.taps) {
            let next = frame.and_then(|frame| frame.get(usize::from(joint.channel)));
            *taps = [taps[1], taps[2], taps[3], next.map_or(taps[3], |&value| joint.goal(value))];
        }
        Ok(frame.is_some())
    }
}
