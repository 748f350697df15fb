//! What plays: a clip, or two while one fades into the next, and what comes after them.

use crate::clock::Speed;
use crate::fault::Fault;
use crate::interpolate::{Fraction, least_jerk, lerp};
use crate::library::{LIVE, Library};
use crate::map::JointMap;
use crate::play_error::PlayError;
use crate::playback::{Playback, SEEK_FRAMES};
use crate::show::Show;
use heapless::Deque;

/// Clips that can wait.
pub const QUEUE: usize = 8;

/// Time in ms in which a clip at normal speed is brought to a stop by a pause.
pub(crate) const PAUSE_MILLIS: u16 = 250;

/// What is to be played, and from where.
#[derive(Clone, Copy, Debug)]
struct Cue {
    clip: u16,
    repeats: bool,
    start: u32,
    /// Where an outside clock is that it is to follow, in 1/65536 of a frame; it is what the start becomes.
    outside: Option<u64>,
    /// Whether it is there only until something else plays.
    idle: bool,
}

impl Cue {
    const fn of(clip: u16, repeats: bool) -> Self {
        Self { clip, repeats, start: 0, outside: None, idle: false }
    }
}

#[derive(Debug)]
struct Playing<F, const N: usize> {
    cue: Cue,
    playback: Playback<F, N>,
}

/// Frames in a tick, in 1/65536, up to which a clip is sought at the side of an outside clock: one fewer than are decoded in a
/// tick, so that the clock is caught up with.
const STRIDE: u64 = (SEEK_FRAMES as u64 - 1) << 16;

/// The clips that play, and those that wait.
pub struct Mixer<'m, L: Library, const N: usize> {
    map: &'m JointMap<N>,
    library: L,
    show: Show<'m>,
    current: Option<Playing<L::Frames, N>>,
    /// What `current` fades into, as soon as it has found its start.
    next: Option<Playing<L::Frames, N>>,
    /// Ticks of the fade, once it has begun.
    faded: Option<u32>,
    /// How much of `next` there is in this tick.
    mix: Fraction,
    /// To be played as soon as two clips do not play already.
    now: Option<Cue>,
    queue: Deque<Cue, QUEUE>,
    /// Clips of the playlist that were played.
    listed: usize,
    speed: Speed,
    wanted: Speed,
    paused: bool,
}

impl<'m, L: Library, const N: usize> Mixer<'m, L, N> {
    /// Before the first clip of the show.
    pub const fn new(map: &'m JointMap<N>, library: L, show: Show<'m>) -> Self {
        Self {
            map,
            library,
            show,
            current: None,
            next: None,
            faded: None,
            mix: Fraction::START,
            now: None,
            queue: Deque::new(),
            listed: 0,
            speed: Speed::NORMAL,
            wanted: Speed::NORMAL,
            paused: false,
        }
    }

    /// What it plays by itself.
    pub const fn show(&self) -> &Show<'m> {
        &self.show
    }

    /// The clips.
    pub const fn library(&mut self) -> &mut L {
        &mut self.library
    }

    /// Whether no clip plays.
    pub const fn is_empty(&self) -> bool {
        self.current.is_none()
    }

    /// The clip that plays, its frame before the tick, and how far the tick is from that in 1/65536 of a frame.
    pub fn position(&self) -> Option<(u16, u32, u16)> {
        let playing = self.current.as_ref()?;
        let (frame, phase) = playing.playback.position();
        Some((playing.cue.clip, frame, phase))
    }

    /// How fast it plays in this tick.
    pub const fn speed(&self) -> Speed {
        self.speed
    }

    /// Where the clips want the joints to be, in 1/1024 goal units; false, and nothing, where none plays.
    #[inline]
    pub fn pose(&self, wanted: &mut [i32]) -> bool {
        let interpolation = self.map.settings().interpolation;
        let Some(current) = &self.current else { return false };
        current.playback.pose(interpolation, wanted, |wanted, goal| *wanted = goal);
        if let (Some(next), Some(_)) = (&self.next, self.faded) {
            next.playback.pose(interpolation, wanted, |wanted, goal| *wanted = lerp(*wanted, goal, self.mix));
        }
        true
    }

    /// Plays a clip now, and forgets what waits.
    pub(crate) fn play(&mut self, clip: u16, repeats: bool) -> Result<(), PlayError> {
        self.cue(Cue::of(clip, repeats))?;
        self.paused = false;
        self.queue.clear();
        self.listed = usize::MAX;
        Ok(())
    }

    /// Plays a clip after those that play and wait.
    pub(crate) fn queue(&mut self, clip: u16, repeats: bool) -> Result<(), PlayError> {
        if !self.library.has(clip) {
            return Err(PlayError::NoClip { clip });
        }
        self.queue.push_back(Cue::of(clip, repeats)).map_err(|_| PlayError::QueueFull)?;
        if let Some(playing) = &mut self.current {
            playing.playback.end();
        }
        Ok(())
    }

    /// Plays the clip of the trigger; false where there is none, or another one plays.
    pub(crate) fn trigger(&mut self) -> Result<bool, PlayError> {
        let plays =
            |playing: &Option<Playing<_, N>>| playing.as_ref().is_some_and(|playing| !playing.cue.idle);
        match self.show.trigger_clip {
            Some(clip) if !plays(&self.current) && !plays(&self.next) && self.now.is_none() => {
                self.cue(Cue::of(clip, false))?;
                self.paused = false;
                Ok(true)
            }
            _ => Ok(false),
        }
    }

    /// Fades to another frame of the clip that plays, or of the one that it fades into.
    pub(crate) fn seek(&mut self, frame: u32) -> Result<(), PlayError> {
        let cue = self.cue_at(frame)?;
        self.cue(cue)
    }

    /// The clip that is sought in, from this frame on.
    fn cue_at(&self, frame: u32) -> Result<Cue, PlayError> {
        let playing = self.next.as_ref().or(self.current.as_ref()).ok_or(PlayError::Nothing)?;
        if playing.cue.clip == LIVE {
            return Err(PlayError::Stream);
        }
        let frames = playing.playback.frames();
        if frame >= frames {
            return Err(PlayError::Beyond { frame, frames });
        }
        Ok(Cue { start: frame, outside: None, ..playing.cue })
    }

    /// Comes to where an outside clock is in this tick: little by little, or by a fade where that is too far. The fade begins as
    /// soon as the frame is decoded at which the clock is then.
    pub(crate) fn sync(&mut self, frame: u32, fraction: u16) -> Result<(), PlayError> {
        let at = u64::from(frame) << 16 | u64::from(fraction);
        let place = if self.next.is_some() { &mut self.next } else { &mut self.current };
        let Some(playing) = place else { return Err(PlayError::Nothing) };
        // What is still sought is only told where the clock is now, so that frequent words do not begin it again and again.
        let sought = self.faded.is_none() && playing.cue.outside.is_some();
        if playing.cue.clip != LIVE && frame >= playing.playback.frames() {
            return Err(PlayError::Beyond { frame, frames: playing.playback.frames() });
        }
        if sought && playing.cue.start <= frame {
            playing.cue.outside = Some(at);
            return Ok(());
        }
        if playing.playback.follow(frame, fraction) {
            return Ok(());
        }
        let cue = self.cue_at(frame)?;
        self.cue(Cue { outside: Some(at), ..cue })
    }

    /// Whether somebody has paused what plays.
    pub const fn is_paused(&self) -> bool {
        self.paused
    }

    /// Pauses what plays, or is to play.
    pub(crate) fn pause(&mut self) -> Result<(), PlayError> {
        if self.current.is_none() && self.now.is_none() && self.queue.is_empty() {
            return Err(PlayError::Nothing);
        }
        self.paused = true;
        Ok(())
    }

    pub(crate) const fn resume(&mut self) {
        self.paused = false;
    }

    pub(crate) const fn set_speed(&mut self, speed: Speed) {
        self.wanted = speed;
    }

    /// Leaves all clips, also those that wait.
    pub(crate) fn drop_clips(&mut self) {
        let playing = [self.current.take(), self.next.take()];
        playing.into_iter().flatten().for_each(|playing| self.library.close(playing.playback.into_frames()));
        self.faded = None;
        self.now = None;
        self.queue.clear();
        self.listed = usize::MAX;
        self.paused = false;
    }

    /// Decodes towards the start of the clip that comes first; true once it is there, or where there is none.
    pub(crate) fn open(&mut self) -> Result<bool, Fault> {
        if self.current.is_none() && self.now.is_none() {
            self.now = self.following();
        }
        self.begin()?;
        match &mut self.current {
            Some(playing) => playing.playback.seek(self.map).map_err(|error| Fault::Clip { error }),
            None => Ok(true),
        }
    }

    /// Goes on by a tick; false after the last frame of the last clip.
    pub(crate) fn advance(&mut self) -> Result<bool, Fault> {
        let damaged = |error| Fault::Clip { error };
        let wanted = if self.paused { Speed::PAUSED } else { self.wanted };
        if self.speed != wanted {
            let step = (256 * 1000u32)
                .div_ceil(u32::from(PAUSE_MILLIS).saturating_mul(self.map.tick_hz().into()).max(1));
            self.speed = self.speed.towards(wanted, u16::try_from(step).unwrap_or(u16::MAX));
        }
        let Some(playing) = &mut self.current else { return Ok(false) };
        // The last frame has its tick as well.
        let ended = playing.playback.ended();
        playing.playback.advance(self.map, self.speed).map_err(damaged)?;
        let (left, idle) = (playing.playback.left(), playing.cue.idle);
        if let Some(next) = &mut self.next {
            match &mut self.faded {
                Some(faded) => {
                    next.playback.advance(self.map, self.speed).map_err(damaged)?;
                    *faded = faded.saturating_add(1);
                    let ticks = self.map.settings().fade_ticks();
                    self.mix = least_jerk(Fraction::of((*faded).min(ticks), ticks.saturating_add(1)));
                }
                None => {
                    if let Some(at) = &mut next.cue.outside {
                        // Of faster clips nothing would ever be caught up with.
                        let stride = next.playback.stride(self.map, self.speed);
                        *at = at.saturating_add(if stride <= STRIDE { stride } else { 0 });
                        next.playback.aim(*at);
                    }
                    if next.playback.seek(self.map).map_err(damaged)? {
                        next.cue.outside = None;
                        (self.faded, self.mix) = (Some(0), Fraction::START);
                    }
                }
            }
            if self.faded.is_some_and(|faded| faded > self.map.settings().fade_ticks()) {
                let last = core::mem::replace(&mut self.current, self.next.take());
                last.into_iter().for_each(|playing| self.library.close(playing.playback.into_frames()));
                self.faded = None;
            }
            return Ok(true);
        }
        let waits = !self.queue.is_empty() || self.list_goes_on();
        // An idle clip gives way at once, and to nothing else.
        let due = if idle { waits } else { left <= self.fade_frames() };
        if due && self.now.is_none() {
            self.now = self.following();
        }
        if ended && self.now.is_none() {
            self.current
                .take()
                .into_iter()
                .for_each(|playing| self.library.close(playing.playback.into_frames()));
            return Ok(false);
        }
        self.begin()?;
        Ok(true)
    }

    /// Asks for a clip as soon as there is room for it.
    fn cue(&mut self, cue: Cue) -> Result<(), PlayError> {
        if self.next.is_none() || self.faded.is_none() {
            // What was to come, and has not begun, is not to come any more.
            self.next
                .take()
                .into_iter()
                .for_each(|playing| self.library.close(playing.playback.into_frames()));
            self.start(cue)
        } else {
            self.now = Some(cue);
            Ok(())
        }
    }

    /// Opens what was asked for, if there is room.
    fn begin(&mut self) -> Result<(), Fault> {
        if self.next.is_some() {
            return Ok(());
        }
        let Some(cue) = self.now.take() else { return Ok(()) };
        match self.start(cue) {
            Ok(()) => Ok(()),
            Err(PlayError::Clip(error)) => Err(Fault::Clip { error }),
            Err(_) => Err(Fault::NoClip { clip: cue.clip }),
        }
    }

    fn start(&mut self, cue: Cue) -> Result<(), PlayError> {
        let frames = self.library.open(cue.clip)?;
        let playback = match Playback::new(frames, self.map, cue.repeats, cue.start) {
            Ok(playback) => playback,
            Err((error, frames)) => {
                self.library.close(frames);
                return Err(error);
            }
        };
        let place = if self.current.is_none() { &mut self.current } else { &mut self.next };
        *place = Some(Playing { cue, playback });
        self.now = None;
        Ok(())
    }

    const fn list_goes_on(&self) -> bool {
        self.listed < self.show.playlist.len() || self.listed != usize::MAX && self.show.repeats
    }

    /// What comes after the clip that plays, taken from where it waits.
    fn following(&mut self) -> Option<Cue> {
        if let Some(cue) = self.queue.pop_front() {
            return Some(cue);
        }
        if self.listed >= self.show.playlist.len() && self.list_goes_on() {
            self.listed = 0;
        }
        if let Some(&clip) = self.show.playlist.get(self.listed) {
            self.listed = self.listed.saturating_add(1);
            return Some(Cue::of(clip, false));
        }
        self.show.idle_clip.map(|clip| Cue { idle: true, ..Cue::of(clip, true) })
    }

    /// Frames of the clip that plays in which it fades.
    fn fade_frames(&self) -> u32 {
        let rate = self.current.as_ref().map_or(0, |playing| playing.playback.rate_centihertz());
        // Both products fit: the speed is at most 1024.
        let doubled = u32::from(rate).wrapping_mul(self.map.settings().fade_millis.into()) / 2000;
        doubled.wrapping_mul(self.speed.parts().into()) / (50 * 256)
    }
}
