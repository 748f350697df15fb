//! Pause, seek and sync: what a host says of the clip that plays.

use super::test_puppet::{FRAMES, TestPuppet, map};
use super::*;
use crate::clock::Speed;
use crate::map::Settings;
use crate::play_error::PlayError;

/// Ticks a second, and frames a second of the clips.
const HZ: u16 = 100;
const RATE: f64 = 60.0;

const PLAY: Command = Command::Play { clip: 1, repeats: true };

fn playing(map: &crate::map::JointMap<4>) -> TestPuppet<'_> {
    let mut puppet = TestPuppet::new(map, Show::default(), [2048; 3]);
    puppet.until_state(2000, State::Resting);
    puppet.machine.command(PLAY).unwrap();
    puppet.until_state(2000, State::Playing);
    puppet
}

/// The frame before the tick, with its part of the next.
fn frame(puppet: &TestPuppet<'_>) -> f64 {
    let (_, frame, phase) = puppet.machine.mixer().position().unwrap();
    f64::from(frame) + f64::from(phase) / 65536.0
}

fn sync(puppet: &mut TestPuppet<'_>, at: f64) -> Result<(), PlayError> {
    let (frame, fraction) = (at.floor() as u32, (at.fract() * 65536.0) as u16);
    puppet.machine.command(Command::Sync { frame, fraction })
}

#[test]
fn a_pause_is_a_state_that_a_stop_a_way_home_and_a_new_play_end() {
    let map = map(Settings::new(HZ));
    let mut puppet = TestPuppet::new(&map, Show::default(), [2048; 3]);
    puppet.until_state(2000, State::Resting);
    assert_eq!(puppet.machine.command(Command::Pause), Err(PlayError::Nothing));
    for (ends, then) in [
        (Command::Stop, State::Holding),
        (Command::Home, State::Resting),
        (PLAY, State::Playing),
        (Command::Resume, State::Playing),
    ] {
        puppet.machine.command(PLAY).unwrap();
        puppet.until_state(2000, State::Playing);
        puppet.machine.command(Command::Pause).unwrap();
        assert_eq!(puppet.machine.state(), State::Paused);
        (0..100).for_each(|_| puppet.tick());
        let stands = frame(&puppet);
        (0..100).for_each(|_| puppet.tick());
        assert_eq!((puppet.machine.state(), frame(&puppet)), (State::Paused, stands));
        puppet.machine.command(ends).unwrap();
        puppet.until_state(2000, then);
        assert!(!puppet.machine.mixer().is_paused(), "{ends:?}");
        // What is played next plays.
        puppet.machine.command(PLAY).unwrap();
        puppet.until_state(2000, State::Playing);
        (0..200).for_each(|_| puppet.tick());
        assert_eq!(puppet.machine.mixer().speed(), Speed::NORMAL, "{ends:?}");
    }
    // One that is to play is paused before its first frame has passed.
    puppet.machine.command(Command::Home).unwrap();
    puppet.until_state(2000, State::Resting);
    puppet.machine.command(PLAY).unwrap();
    puppet.machine.command(Command::Pause).unwrap();
    puppet.until_state(2000, State::Paused);
}

#[test]
fn what_is_not_there_is_refused_at_once() {
    let map = map(Settings::new(HZ));
    let mut puppet = TestPuppet::new(&map, Show::default(), [2048; 3]);
    puppet.until_state(2000, State::Resting);
    for command in [Command::Seek { frame: 0 }, Command::Sync { frame: 0, fraction: 0 }] {
        assert_eq!(puppet.machine.command(command), Err(PlayError::Nothing));
    }
    let missing = PlayError::NoClip { clip: 9 };
    assert_eq!(puppet.machine.command(Command::Queue { clip: 9, repeats: false }), Err(missing));
    assert_eq!(puppet.machine.state(), State::Resting, "it does not get up for nothing");
    puppet.machine.command(PLAY).unwrap();
    puppet.until_state(2000, State::Playing);
    assert_eq!(puppet.machine.command(Command::Queue { clip: 9, repeats: false }), Err(missing));
    let beyond = PlayError::Beyond { frame: FRAMES, frames: FRAMES };
    assert_eq!(puppet.machine.command(Command::Seek { frame: FRAMES }), Err(beyond));
    assert_eq!(puppet.machine.command(Command::Sync { frame: FRAMES, fraction: 0 }), Err(beyond));
    puppet.machine.command(Command::Seek { frame: FRAMES - 1 }).unwrap();
}

/// An outside clock that is far off: after one sync, and the fade that it begins, the clip is with it to 20 ms, however long the way
/// to the frame took; a second sync only makes it finer. Sync again and again does not hinder it.
#[test]
fn a_clock_that_is_far_off_is_locked_to_within_two_syncs() {
    for fade_millis in [0, 500] {
        for (every, speed) in [(100, 256), (10, 256), (1, 256), (100, 128), (50, 512)] {
            for ahead in [10.0, 60.0, 130.0, -30.0] {
                let map = map(Settings { fade_millis, ..Settings::new(HZ) });
                let mut puppet = playing(&map);
                puppet.machine.command(Command::Speed(Speed::new(speed))).unwrap();
                (0..120).for_each(|_| puppet.tick());
                let start = frame(&puppet) + ahead;
                let step = RATE / f64::from(HZ) * f64::from(speed) / 256.0;
                let outside = |tick: u32| (start + step * f64::from(tick)).rem_euclid(f64::from(FRAMES));
                let mut worst = 0.0f64;
                for tick in 0..200 {
                    if tick % every == 0 {
                        sync(&mut puppet, outside(tick)).unwrap();
                    }
                    let off = (frame(&puppet) - outside(tick)).abs();
                    let off = off.min(f64::from(FRAMES) - off) / RATE * 1000.0;
                    // The way is at most 240 frames of 8 a tick, and the fade.
                    if tick > 100 {
                        worst = worst.max(off);
                    }
                    puppet.tick();
                }
                assert!(worst < 20.0, "{worst} ms: fade {fade_millis}, every {every}, {speed}/256, {ahead}");
            }
        }
    }
}
