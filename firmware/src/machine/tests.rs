use super::test_puppet::*;
use super::*;
use crate::clock::Speed;
use crate::fault::Fault;
use crate::map::{Interpolation, Policy, Settings};
use crate::play_error::PlayError;
use proptest::prelude::*;
use servo_wire::bus::BusError;

#[test]
fn from_any_posture_to_the_clip_and_home_without_a_jump() {
    let map = map(Settings::new(HZ));
    for positions in [[2048; 3], [500, 3500, 2000], [3499, 501, 700], [100, 4000, -3000]] {
        let mut puppet = TestPuppet::new(&map, show(), positions);
        puppet.until_state(20, State::Arming);
        assert_eq!(puppet.positions(), positions, "nothing moves before it is held");
        puppet.until_state(2000, State::Playing);
        for (channel, position) in puppet.positions().into_iter().enumerate() {
            let first = map.joints()[channel].goal(value(1, 0, channel)) >> 10;
            assert!((position - first).abs() <= 1, "{position} {first}");
        }
        // 240 frames at 60 Hz: ⌈239 · 100 / 60⌉ + 1 ticks.
        let ticks = puppet.until_state(1000, State::Stopping);
        assert_eq!(ticks, 400);
        puppet.until_state(1000, State::Resting);
        assert_eq!(puppet.positions(), [2000; 3]);
        assert!(puppet.machine.at_rest());
        assert_eq!(puppet.watched, Some(200));
    }
}

#[test]
fn clips_are_played_as_recorded() {
    let settings = Settings { interpolation: Interpolation::Linear, ..Settings::new(60) };
    let map = map(settings);
    let mut puppet = TestPuppet::new(&map, show(), [2048; 3]);
    puppet.until_state(2000, State::Playing);
    // At 60 Hz each tick is a frame, and the idle layer fades in.
    for frame in 0..200 {
        puppet.tick();
        let position = puppet.positions()[0];
        let exact = map.joints()[0].goal(value(1, frame, 0)) >> 10;
        assert!((position - exact).abs() <= 36, "frame {frame}: {position} {exact}");
    }
}

#[test]
fn playlists_fade_from_clip_to_clip() {
    let map = map(Settings::new(HZ));
    let show = Show { playlist: &[1, 2, 3], after: After::Hold, ..Show::default() };
    let mut puppet = TestPuppet::new(&map, show, [2048; 3]);
    puppet.until_state(2000, State::Playing);
    let mut seen = Vec::new();
    while puppet.machine.state() == State::Playing {
        puppet.tick();
        if let Some((clip, ..)) = puppet.machine.mixer().position()
            && seen.last() != Some(&clip)
        {
            seen.push(clip);
        }
    }
    assert_eq!(seen, [1, 2, 3]);
    puppet.until_state(100, State::Holding);
    assert!(puppet.machine.at_rest());
    assert_eq!(puppet.machine.library().open, 0);
}

#[test]
fn an_idle_clip_fills_the_gaps_and_the_trigger_interrupts_it() {
    let map = map(Settings::new(HZ));
    let show = Show { idle_clip: Some(0), trigger_clip: Some(2), ..Show::default() };
    let mut puppet = TestPuppet::new(&map, show, [2048; 3]);
    puppet.until_state(2000, State::Playing);
    for _ in 0..3 {
        (0..1000).for_each(|_| puppet.tick());
        let clip = |puppet: &TestPuppet<'_>| puppet.machine.mixer().position().map(|at| at.0);
        assert_eq!((puppet.machine.state(), clip(&puppet)), (State::Playing, Some(0)));
        puppet.machine.command(Command::Trigger).unwrap();
        puppet.until(100, |puppet| clip(puppet) == Some(2));
        // A second press does not start it again.
        (0..100).for_each(|_| puppet.tick());
        puppet.machine.command(Command::Trigger).unwrap();
        puppet.until(400, |puppet| clip(puppet) == Some(0));
    }
}

#[test]
fn speed_pause_seek_and_stop() {
    let map = map(Settings::new(HZ));
    let show = Show { idle_clip: Some(1), ..Show::default() };
    let mut puppet = TestPuppet::new(&map, show, [2048; 3]);
    puppet.until_state(2000, State::Playing);
    let frame = |puppet: &TestPuppet<'_>| puppet.machine.mixer().position().unwrap().1;
    puppet.machine.command(Command::Speed(Speed::new(128))).unwrap();
    (0..100).for_each(|_| puppet.tick());
    let before = frame(&puppet);
    (0..200).for_each(|_| puppet.tick());
    assert!((59..=61).contains(&(frame(&puppet) - before)), "half speed");
    puppet.machine.command(Command::Pause).unwrap();
    (0..60).for_each(|_| puppet.tick());
    let (paused, clip) = (frame(&puppet), puppet.machine.mixer().position().unwrap());
    (0..100).for_each(|_| puppet.tick());
    assert_eq!(puppet.machine.mixer().position().unwrap(), clip);
    puppet.machine.command(Command::Resume).unwrap();
    (0..60).for_each(|_| puppet.tick());
    assert!(frame(&puppet) > paused);
    puppet.machine.command(Command::Seek { frame: 20 }).unwrap();
    puppet.until(100, |puppet| (20..60).contains(&frame(puppet)));
    puppet.machine.command(Command::Stop).unwrap();
    puppet.until_state(30, State::Holding);
    assert!(puppet.machine.mixer().is_empty());
    let held = puppet.positions();
    let mut moved = 0;
    for _ in 0..500 {
        puppet.tick();
        moved = puppet.positions().iter().zip(held).map(|(a, b)| (a - b).abs()).fold(moved, i32::max);
    }
    assert!((3..=35).contains(&moved), "it breathes, by {moved}");
    puppet.machine.command(Command::Home).unwrap();
    puppet.until_state(500, State::Resting);
    assert_eq!(
        puppet.machine.command(Command::Play { clip: 9, repeats: false }),
        Err(PlayError::NoClip { clip: 9 })
    );
    puppet.machine.command(Command::Play { clip: 3, repeats: false }).unwrap();
    puppet.until_state(500, State::Playing);
    puppet.until(1000, |puppet| puppet.machine.mixer().position().is_some_and(|at| at.0 == 1));
}

#[test]
fn an_outside_clock_is_followed() {
    let map = map(Settings::new(HZ));
    let mut puppet = TestPuppet::new(&map, Show { idle_clip: Some(1), ..Show::default() }, [2048; 3]);
    puppet.until_state(2000, State::Playing);
    (0..100).for_each(|_| puppet.tick());
    // The outside is at frame 62 while the clip is at 60, and runs on.
    let (_, at, phase) = puppet.machine.mixer().position().unwrap();
    puppet.machine.command(Command::Sync { frame: at + 2, fraction: phase }).unwrap();
    (0..100).for_each(|_| puppet.tick());
    let (_, now, _) = puppet.machine.mixer().position().unwrap();
    // A second is 60 frames.
    assert!((61..=63).contains(&(now - at)), "{at} {now}");
    puppet.machine.command(Command::Sync { frame: 150, fraction: 0 }).unwrap();
    puppet.until(100, |puppet| puppet.machine.mixer().position().unwrap().1 >= 150);
}

/// Ticks from a fault to the state that its policy says.
fn settle(policy: Policy, state: State, harm: impl Fn(&mut TestPuppet<'_>), expected: Fault) -> u32 {
    let map = map(Settings { policy, ..Settings::new(HZ) });
    let mut puppet = TestPuppet::new(&map, Show { idle_clip: Some(1), ..Show::default() }, [2048; 3]);
    puppet.until_state(2000, State::Playing);
    (0..137).for_each(|_| puppet.tick());
    let before = puppet.positions();
    harm(&mut puppet);
    let ticks =
        puppet.until(500, |puppet| puppet.machine.fault().is_some() && puppet.machine.state() == state);
    assert_eq!(puppet.machine.fault(), Some(expected));
    // It latches, and nothing plays.
    (0..300).for_each(|_| puppet.tick());
    assert_eq!(
        (puppet.machine.fault(), puppet.machine.command(Command::Play { clip: 1, repeats: true })),
        (Some(expected), Ok(()))
    );
    (0..300).for_each(|_| puppet.tick());
    assert_ne!(puppet.machine.state(), State::Playing);
    if state == State::Holding && puppet.bus.is_ok() {
        let moved = puppet.positions().iter().zip(before).map(|(a, b)| (a - b).abs()).max().unwrap();
        assert!(moved <= 300, "held where it was, {moved}");
    }
    // Made good and acknowledged it plays again.
    puppet.bus = Ok(());
    puppet.late = false;
    puppet.machine.library().damaged_at = None;
    for motor in &mut puppet.motors {
        (motor.silent, motor.temperature) = (false, 30);
    }
    puppet.machine.command(Command::Acknowledge).unwrap();
    puppet.until_state(2000, State::Playing);
    assert_eq!(puppet.machine.fault(), None);
    ticks
}

#[test]
fn every_fault_leads_to_a_held_pose_within_100_ms() {
    let hold = |harm: fn(&mut TestPuppet<'_>), fault| settle(Policy::Hold, State::Holding, harm, fault);
    type Case = (fn(&mut TestPuppet<'_>), Fault);
    let cases: [Case; 9] = [
        (|puppet| puppet.motors[1].silent = true, Fault::Silent { servo: 1 }),
        (|puppet| puppet.motors[2].temperature = 70, Fault::Overheated { servo: 2 }),
        (|puppet| puppet.motors[0].hardware_error = 1 << 5, Fault::Overloaded { servo: 0 }),
        (|puppet| puppet.motors[0].hardware_error = 1 << 0, Fault::Voltage { servo: 0 }),
        (|puppet| puppet.bus = Err(BusError::NoReply), Fault::Bus { error: BusError::NoReply }),
        (|puppet| puppet.late = true, Fault::Late),
        (|puppet| puppet.machine.command(Command::LinkLost).unwrap(), Fault::LinkLost),
        (|puppet| puppet.motors[1].torque = false, Fault::Rebooted { servo: 1 }),
        (|puppet| puppet.motors[1].hardware_error = 1 << 6, Fault::ServoWatchdog { servo: 1 }),
    ];
    for (harm, fault) in cases {
        let ticks = hold(harm, fault);
        assert!(ticks <= 10, "{fault:?}: {ticks} ticks of 10 ms");
    }
}

#[test]
fn policies_go_home_or_let_go() {
    let hot: fn(&mut TestPuppet<'_>) = |puppet| puppet.motors[2].temperature = 70;
    let fault = Fault::Overheated { servo: 2 };
    settle(Policy::EaseHome, State::Resting, hot, fault);
    assert!(settle(Policy::TorqueOff, State::Limp, hot, fault) <= 2);
}

#[test]
fn a_servo_that_restarted_is_held_where_it_is() {
    let map = map(Settings::new(HZ));
    let mut puppet = TestPuppet::new(&map, Show { idle_clip: Some(1), ..Show::default() }, [2048; 3]);
    puppet.until_state(2000, State::Playing);
    (0..100).for_each(|_| puppet.tick());
    puppet.motors[1].torque = false;
    puppet.motors[1].position -= 200;
    let fallen = puppet.motors[1].position;
    puppet.watched = None;
    (0..20).for_each(|_| puppet.tick());
    assert_eq!((puppet.motors[1].torque, puppet.motors[1].position), (true, fallen));
    assert_eq!(puppet.watched, Some(200), "its watchdog is armed again");
    assert_eq!(puppet.machine.fault(), Some(Fault::Rebooted { servo: 1 }));
    puppet.machine.command(Command::Acknowledge).unwrap();
    puppet.until_state(2000, State::Playing);
}

#[test]
fn a_bus_that_comes_back_finds_the_servos_where_they_are() {
    let map = map(Settings::new(HZ));
    let mut puppet = TestPuppet::new(&map, Show { idle_clip: Some(1), ..Show::default() }, [2048; 3]);
    puppet.until_state(2000, State::Playing);
    // Where the first joint is fastest.
    (0..150).for_each(|_| puppet.tick());
    let before = puppet.positions();
    puppet.bus = Err(BusError::NoReply);
    (0..5).for_each(|_| puppet.tick());
    assert!(puppet.told.iter().any(|(&index, told)| (told - before[index]).abs() > 4), "it was moving");
    (0..25).for_each(|_| puppet.tick());
    assert!(puppet.told.is_empty(), "nobody is told what nobody hears");
    puppet.bus = Ok(());
    (0..30).for_each(|_| puppet.tick());
    assert_eq!(puppet.positions(), before);
}

/// However long its line is loose, and wherever in the movement that was.
#[test]
fn a_servo_that_comes_back_is_told_to_go_no_further_than_it_moves_in_two_ticks() {
    let map = map(Settings::new(HZ));
    for start in 100..140 {
        for ticks in 1..30 {
            let mut puppet = TestPuppet::new(&map, Show { idle_clip: Some(1), ..Show::default() }, [2048; 3]);
            puppet.until_state(2000, State::Playing);
            (0..start).for_each(|_| puppet.tick());
            puppet.longest = 0;
            (0..20).for_each(|_| puppet.tick());
            let usual = puppet.longest;
            let stood = puppet.motors[1].position;
            puppet.motors[1].silent = true;
            (0..ticks).for_each(|_| puppet.tick());
            puppet.motors[1].silent = false;
            puppet.tick();
            let way = (puppet.motors[1].position - stood).abs();
            let most = 2 * (usual + 1);
            assert!(way <= most, "loose for {ticks} ticks: told to go {way} at once, at most {most}");
            // And then to where the others are.
            (0..100).for_each(|_| puppet.tick());
            assert_eq!(puppet.machine.fault().is_some(), ticks >= 6, "{ticks}");
        }
    }
}

/// An acknowledgement in the middle of a movement waits for its end, since nobody is read while servos are looked for.
#[test]
fn a_puppet_that_moves_is_not_looked_for() {
    let map = map(Settings { policy: Policy::EaseHome, ..Settings::new(HZ) });
    let mut puppet = TestPuppet::new(&map, Show { idle_clip: Some(1), ..Show::default() }, [2048; 3]);
    puppet.until_state(2000, State::Playing);
    (0..137).for_each(|_| puppet.tick());
    puppet.machine.command(Command::LinkLost).unwrap();
    puppet.until_state(100, State::Returning);
    (0..100).for_each(|_| puppet.tick());
    puppet.machine.command(Command::Acknowledge).unwrap();
    assert_eq!((puppet.machine.state(), puppet.machine.fault()), (State::Stopping, Some(Fault::LinkLost)));
    puppet.until_state(20, State::Finding);
    assert_eq!(puppet.machine.fault(), None);
    let still = puppet.positions();
    puppet.until_state(20, State::Easing);
    let moved = puppet.positions().iter().zip(still).map(|(a, b)| (a - b).abs()).max();
    assert_eq!(moved, Some(0));
    puppet.until_state(2000, State::Playing);
}

#[test]
fn a_damaged_clip_is_left() {
    let map = map(Settings::new(HZ));
    let mut puppet = TestPuppet::new(&map, Show::default(), [2048; 3]);
    puppet.machine.library().damaged_at = Some(50);
    puppet.until_state(2000, State::Resting);
    puppet.machine.command(Command::Play { clip: 1, repeats: false }).unwrap();
    puppet.until(1000, |puppet| puppet.machine.fault().is_some());
    assert_eq!(puppet.machine.fault(), Some(Fault::Clip { error: DAMAGED }));
    puppet.until_state(10, State::Holding);
    assert_eq!(puppet.machine.library().open, 0);
}

#[test]
fn a_missing_servo_is_a_fault_and_the_others_are_held() {
    let map = map(Settings::new(HZ));
    let mut puppet = TestPuppet::new(&map, show(), [2048; 3]);
    puppet.motors[1].silent = true;
    puppet.until_state(600, State::Holding);
    assert_eq!(puppet.machine.fault(), Some(Fault::Silent { servo: 1 }));
    assert_eq!(puppet.motors.map(|motor| motor.torque), [true, false, true]);
}

#[test]
fn a_servo_with_a_hardware_error_is_restarted_at_the_start() {
    let map = map(Settings::new(HZ));
    let mut puppet = TestPuppet::new(&map, show(), [2048; 3]);
    puppet.motors[1].hardware_error = 1 << 5;
    puppet.until_state(600, State::Playing);
    assert!(puppet.actions.contains(&Action::Reboot { servo: 1 }));
}

#[test]
fn after_a_restart_by_itself_nothing_plays_before_someone_looked() {
    let map = map(Settings::new(HZ));
    let mut puppet = TestPuppet::new(&map, show(), [2048; 3]);
    puppet.machine = Machine::new(&map, FormulaClips::default(), show(), Start::ByItself);
    puppet.until_state(100, State::Holding);
    (0..300).for_each(|_| puppet.tick());
    assert_eq!((puppet.machine.state(), puppet.positions()), (State::Holding, [2048; 3]));
    puppet.machine.command(Command::Acknowledge).unwrap();
    puppet.until_state(600, State::Playing);
}

proptest! {
    /// Whatever is commanded and whatever fails: `TestPuppet::tick` checks every goal.
    #[test]
    fn nothing_makes_it_jump(
        events in prop::collection::vec((0u32..60, 0u8..24, any::<u32>()), 1..60),
        policy in 0u8..3,
        start in prop::array::uniform3(0i32..4096),
    ) {
        let policy = [Policy::Hold, Policy::EaseHome, Policy::TorqueOff][usize::from(policy)];
        let settings = Settings { policy, ease_millis: 300, ..Settings::new(HZ) };
        let map = map(settings);
        let show = Show { playlist: &[1, 2], idle_clip: Some(0), trigger_clip: Some(3), ..Show::default() };
        let mut puppet = TestPuppet::new(&map, show, start);
        for (wait, event, value) in events {
            let servo = value as usize % SERVOS;
            let clip = (value >> 8) as u16 % 5;
            let frame = value >> 8 & 0xff;
            let command = match event {
                0..3 => Some(Command::Play { clip, repeats: value & 1 == 0 }),
                3 => Some(Command::Queue { clip, repeats: value & 1 == 0 }),
                4 => Some(Command::Pause),
                5 => Some(Command::Resume),
                6 => Some(Command::Speed(Speed::new(value as u16))),
                7 => Some(Command::Seek { frame }),
                8 => Some(Command::Sync { frame, fraction: value as u16 }),
                9 => Some(Command::Stop),
                10 => Some(Command::Home),
                11 => Some(Command::Trigger),
                12 => Some(Command::LinkLost),
                13..17 => Some(Command::Acknowledge),
                _ => None,
            };
            match event {
                17 => puppet.motors[servo].silent ^= true,
                18 => puppet.motors[servo].hardware_error ^= 1 << 5,
                19 => puppet.motors[servo].torque = false,
                20 => puppet.bus = if puppet.bus.is_ok() { Err(BusError::Corrupt) } else { Ok(()) },
                21 => puppet.late ^= true,
                22 => puppet.motors[servo].temperature ^= 100,
                23 if !puppet.motors[servo].torque => {
                    // No hand does that between a reading and the goal after it.
                    let position = (value >> 16) as i32 & 4095;
                    puppet.motors[servo].position = position;
                    puppet.readings[servo].iter_mut().for_each(|reading| reading.position = position);
                }
                _ => {}
            }
            if let Some(command) = command {
                let _ = puppet.machine.command(command);
            }
            (0..wait).for_each(|_| puppet.tick());
        }
    }
}

/// At two ticks a second the time in which a servo comes back is one tick.
#[test]
fn a_servo_with_an_error_is_restarted_at_the_slowest_ticks_too() {
    for hz in [1, 2, 3, 5, HZ] {
        let map = map(Settings::new(hz));
        let mut puppet = TestPuppet::new(&map, Show::default(), [2000; 3]);
        puppet.motors[1].hardware_error = 1 << 5;
        puppet.until(3000, |puppet| puppet.machine.at_rest());
        let restarts = puppet.actions.iter().filter(|action| **action == Action::Reboot { servo: 1 });
        assert_eq!((restarts.count(), puppet.machine.fault()), (1, None), "at {hz} Hz");
        assert!(puppet.motors.iter().all(|motor| motor.torque));
    }
}

/// What a servo forgives between two packets is longer than a tick.
#[test]
fn a_servos_own_watchdog_outlasts_a_tick() {
    for (hz, expected) in [(1, 2000), (2, 1000), (4, 500), (5, 400), (6, 200), (HZ, 200)] {
        let map = map(Settings::new(hz));
        let mut puppet = TestPuppet::new(&map, Show::default(), [2000; 3]);
        puppet.until(3000, |puppet| puppet.machine.at_rest());
        assert_eq!(puppet.watched, Some(expected), "at {hz} Hz");
    }
}

/// A clip of so many frames a tick that a tick could not decode them is refused when it is opened.
#[test]
fn a_clip_that_is_too_fast_for_the_ticks_is_refused() {
    for (hz, fits) in [(4, true), (3, false)] {
        let map = map(Settings::new(hz));
        let mut puppet = TestPuppet::new(&map, Show::default(), [2000; 3]);
        puppet.until(3000, |puppet| puppet.machine.at_rest());
        let played = puppet.machine.command(Command::Play { clip: 1, repeats: false });
        let error = PlayError::TooFast { rate_centihertz: 6000, tick_hz: hz };
        assert_eq!(played, if fits { Ok(()) } else { Err(error) }, "at {hz} Hz");
    }
}
