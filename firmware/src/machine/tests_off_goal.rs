//! Servos that are not where they are told to be, and servos that do not let go.

use super::test_puppet::*;
use super::*;
use crate::fault::Fault;
use crate::map::{Joint, JointMap, Policy, Settings};

/// Ticks of a puppet whose second servo does something else than it is told, until it rests, and its fault.
fn play<'m>(map: &'m JointMap<4>, at: [i32; SERVOS], odd: Odd) -> (TestPuppet<'m>, u32) {
    let mut puppet = TestPuppet::new(map, show(), at);
    puppet.odd = Some((1, odd));
    let ticks = puppet.until(4000, |puppet| puppet.machine.at_rest());
    (puppet, ticks)
}

#[test]
fn a_shaft_that_stands_is_a_fault_in_time_and_is_not_pushed() {
    for policy in [Policy::Hold, Policy::EaseHome, Policy::TorqueOff] {
        let map = map(Settings { policy, ..Settings::new(HZ) });
        let (mut puppet, _) = play(&map, [2000; 3], |_, _| {});
        let Some(Fault::NotFollowing { servo: 1, goal, position: 2000 }) = puppet.machine.fault() else {
            panic!("{policy:?}: {:?}", puppet.machine.fault())
        };
        // 10° are 113 goal units; and as far as it may go in 0.3 s and three ticks.
        assert!((114..=114 + 33 * 60).contains(&(goal - 2000).abs()), "{policy:?}: told {goal}");
        let expected = match policy {
            Policy::Hold => State::Holding,
            Policy::EaseHome => State::Resting,
            Policy::TorqueOff => State::Limp,
        };
        assert_eq!(puppet.machine.state(), expected);
        assert_eq!(puppet.machine.goals()[1].position, 2000, "its motor does not push");
        // Freed and acknowledged it plays.
        (puppet.odd, puppet.velocity) = (None, [None; SERVOS]);
        puppet.machine.command(Command::Acknowledge).unwrap();
        puppet.until_state(2000, State::Playing);
        assert_eq!(puppet.machine.fault(), None);
    }
}

/// A servo in velocity mode whose motor runs, and one whose own limits end before the joint's.
#[test]
fn a_servo_that_runs_away_or_stops_short_is_a_fault() {
    let map = map(Settings::new(HZ));
    let odd: [Odd; 2] =
        [|servo, _| servo.position += 3, |servo, goal| servo.position = goal.clamp(1990, 2010)];
    for odd in odd {
        let (puppet, _) = play(&map, [2000; 3], odd);
        assert!(matches!(puppet.machine.fault(), Some(Fault::NotFollowing { servo: 1, .. })));
    }
}

#[test]
fn servos_that_are_slow_or_late_are_no_fault() {
    let map = map(Settings::new(HZ));
    let odd: [Odd; 3] = [
        // As slow as 26° a second, of a joint that may do 530.
        |servo, goal| servo.position += (goal - servo.position).clamp(-3, 3),
        // It comes no nearer than 9°, as under a load.
        |servo, goal| servo.position = goal + 100,
        // A low pass of a fifth of a second.
        |servo, goal| servo.position += (goal - servo.position) / 20,
    ];
    for odd in odd {
        let (puppet, _) = play(&map, [2000; 3], odd);
        assert_eq!((puppet.machine.state(), puppet.machine.fault()), (State::Resting, None));
    }
}

#[test]
fn what_a_map_allows_is_no_fault() {
    let map = map(Settings { following_tenths: 0, ..Settings::new(HZ) });
    let (puppet, _) = play(&map, [2000; 3], |_, _| {});
    assert_eq!((puppet.machine.state(), puppet.machine.fault()), (State::Resting, None));
}

/// A map whose joints have this range.
fn ranged(min: i32, max: i32) -> JointMap<4> {
    let joints = (1..=SERVOS as u8).map(|id| Joint { min, max, home: max, ..joint(id) });
    JointMap::new(
        Settings::new(HZ),
        map(Settings::new(HZ)).buses().iter().copied().collect(),
        joints.collect(),
    )
    .unwrap()
}

/// In position mode a servo forgets its turns as its torque comes on.
#[test]
fn a_servo_beyond_its_turn_is_not_moved_and_is_let_go() {
    // Slack beyond the turn; and within it, as it is after its power came on.
    for (range, slack, on) in [
        ((3000, 4000), 4200, 104),
        ((3000, 4000), 104, 104),
        ((100, 1000), -100, 3996),
        ((100, 1000), 3996, 3996),
    ] {
        let map = ranged(range.0, range.1);
        let mut puppet = TestPuppet::new(&map, show(), [range.1, slack, range.1]);
        puppet.wraps = true;
        puppet.until(2000, |puppet| puppet.machine.at_rest());
        assert_eq!(puppet.machine.fault(), Some(Fault::BeyondTurn { servo: 1, position: on }), "{slack}");
        assert_eq!(puppet.motors[1].position.rem_euclid(4096), on, "it stands");
        assert_eq!(puppet.motors.map(|motor| motor.torque), [true, false, true], "{slack}");
        // Turned into its range it plays.
        puppet.motors[1].position = range.0 + 100;
        puppet.machine.command(Command::Acknowledge).unwrap();
        puppet.until_state(3000, State::Playing);
        assert_eq!(puppet.machine.fault(), None);
    }
}

/// In range again once it has forgotten its turn, it goes on from there; and in extended position mode the numbers lead back.
#[test]
fn a_servo_is_where_it_says_it_is_after_its_torque_came_on() {
    let map = ranged(100, 3900);
    for (wraps, slack) in [(true, 4200), (true, -100), (false, 4200), (false, -100)] {
        let mut puppet = TestPuppet::new(&map, show(), [2000, slack, 2000]);
        puppet.wraps = wraps;
        puppet.until_state(4000, State::Playing);
        assert_eq!(puppet.machine.fault(), None, "{wraps} {slack}");
    }
}

/// A reading that is wrong once moves nothing.
#[test]
fn one_wrong_reading_as_torque_comes_on_moves_nothing() {
    let map = map(Settings::new(HZ));
    for wrong in [0, 2500, 4095] {
        let mut puppet = TestPuppet::new(&map, show(), [2000; 3]);
        puppet.until(50, |puppet| puppet.motors[1].torque);
        puppet.readings[1].as_mut().unwrap().position = wrong;
        puppet.until_state(2000, State::Playing);
        assert_eq!(puppet.machine.fault(), None, "{wrong}");
    }
}

#[test]
fn a_joint_outside_its_range_eases_in_and_a_clamped_way_takes_no_longer() {
    let map = map(Settings::new(HZ));
    let mut puppet = TestPuppet::new(&map, show(), [4400, 2000, 2000]);
    puppet.until_state(100, State::Easing);
    let mut fastest = 0;
    while puppet.machine.state() == State::Easing {
        let before = puppet.motors[0].position;
        puppet.tick();
        fastest = fastest.max((puppet.motors[0].position - before).abs());
    }
    // A quarter of 60 goal units a tick.
    assert!((8..=16).contains(&fastest), "{fastest} goal units a tick");
    // Clip 3 begins far outside the range of a narrow joint: the way is to the end of that.
    let map = ranged(1900, 2100);
    let mut puppet = TestPuppet::new(&map, Show { playlist: &[3], ..show() }, [2000; 3]);
    puppet.until_state(100, State::Easing);
    let ticks = puppet.until_state(3000, State::Playing);
    assert!(ticks <= 205, "{ticks} ticks, 200 are the least");
}

#[test]
fn letting_go_is_repeated_until_each_servo_has_confirmed_it() {
    let map = map(Settings { policy: Policy::TorqueOff, ..Settings::new(HZ) });
    let mut puppet = TestPuppet::new(&map, show(), [2000; 3]);
    puppet.until_state(2000, State::Playing);
    puppet.motors[1].silent = true;
    puppet.until_state(20, State::LettingGo);
    (0..3).for_each(|_| puppet.tick());
    assert_eq!(puppet.motors.map(|motor| motor.torque), [false, true, false]);
    assert!(puppet.machine.may_hold().eq([1]) && !puppet.machine.at_rest());
    // After two seconds that is what it comes to, but it is asked on.
    puppet.until(250, |puppet| puppet.machine.at_rest());
    assert_eq!((puppet.machine.state(), puppet.watched), (State::LettingGo, Some(200)));
    (0..500).for_each(|_| puppet.tick());
    puppet.motors[1].silent = false;
    let ticks = puppet.until_state(10, State::Limp);
    assert!(ticks <= 3 && puppet.machine.may_hold().next().is_none(), "{ticks}");
    assert_eq!(puppet.motors.map(|motor| motor.torque), [false; 3]);
    assert!(!puppet.actions.contains(&Action::Watchdog { millis: 0 }) || puppet.watched == Some(200));
}
