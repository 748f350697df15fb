//! Live frames of the Blender add-on move virtual servos: in simulated time, and by `bunraku follow` in real time.
#![allow(clippy::unwrap_used)]
#![cfg(unix)]

use bunraku_tests::clock::SimulatedClock;
use bunraku_tests::{bunraku, workspace};
use host_sim::clip::Clip;
use host_sim::play::{Performance, virtual_bus};
use host_sim::ports::{self, Clock, Told};
use host_sim::puppet::joint_names::JointNames;
use puppet_file::Puppet;
use std::cell::{Cell, RefCell};
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::atomic::AtomicUsize;
use std::sync::mpsc::channel;
use std::thread::sleep;
use std::time::{Duration, Instant};
use virtual_servos::config::ServoConfig;
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::hobby::HobbyBoard;
use virtual_servos::virtual_bus::{Disturbance, Event, VirtualBus};

/// The servo that is moved, and how far it goes.
const HEAD: u8 = 2;
const ENDS: [u16; 2] = [1300, 2800];

/// How long frames jump from end to end, from the moment on in which the player is open for them.
const JUMPING: Duration = Duration::from_secs(6);

/// What comes while the player is not open yet: half a frame.
const NOISE: [u8; 4] = *b"<<\x02>";

/// The states that a player goes through to its end, but for the short one in which it brakes.
const STATES: [&str; 7] = ["Finding", "Reading", "Arming", "Opening", "Easing", "Playing", "Holding"];

fn puppet() -> PathBuf {
    workspace().join("puppets/sample.toml")
}

/// As the add-on sends it.
fn frame(id: u8, position: u16) -> [u8; 5] {
    let [high, low] = position.to_be_bytes();
    [b'<', id, high, low, b'>']
}

/// What is sent so long after the player was open: half a frame, bytes that are none, a frame for somebody else, and one of a
/// servo that goes to the other end every second.
fn sent(since: Duration) -> Vec<u8> {
    let end = ENDS[usize::from(since.as_secs() % 2 == 1)];
    [&frame(HEAD, end)[..3], b"\x00\x01", &frame(200, 7), &frame(HEAD, end)].concat()
}

/// Nowhere does the servo go faster, or gain more speed, than it may.
fn within_limits(told: &[i32]) {
    // From where it is; 450 degrees a second, reached in 50 ms, at 50 Hz: 102.4 goal units a tick, and 41 more or fewer than
    // before.
    assert_eq!(told[0], 2048);
    for three in told.windows(3) {
        let (before, after) = (three[1] - three[0], three[2] - three[1]);
        assert!(after.abs() <= 103 && (after - before).abs() <= 42, "{three:?}");
    }
}

/// What a player came to.
struct Followed {
    /// The goals of the servo.
    told: Vec<i32>,
    states: Vec<String>,
    /// Why it ended.
    error: String,
}

/// Follows in simulated time, in which the machine is too late by `late` in each tick from the first frame on.
fn follow(late: Duration) -> Followed {
    let puppet = Puppet::read(&puppet()).unwrap();
    let map = puppet.map(puppet.channels().unwrap()).unwrap();
    let joints = map.joints().iter();
    let servos = joints.map(|joint| ServoConfig { position: joint.home, ..ServoConfig::new(joint.id) });
    let mut servos =
        DynamixelServos::new(&DynamixelConfig { servos: servos.collect(), ..DynamixelConfig::with_ids(&[]) })
            .unwrap();
    let (sender, receiver) = channel();
    let (states, told, open) = (RefCell::new(Vec::new()), RefCell::new(Vec::new()), Cell::new(None));
    let clock = SimulatedClock::new(|now| {
        if open.get().is_none() && states.borrow().iter().any(|state| state == "Opening") {
            open.set(Some(now));
        }
        let bytes = match open.get() {
            None => NOISE.to_vec(),
            Some(open) if now - open < JUMPING => sent(now - open),
            Some(_) => return,
        };
        sender.send(bytes).unwrap();
    });
    let hear = |bytes: &[u8]| {
        servos.receive(bytes, clock.now().as_micros() as u64, &mut |event| {
            if let Event::Goal { id: HEAD, position, .. } = event {
                told.borrow_mut().push(position);
            }
        })
    };
    let bus = virtual_bus(&map, &HobbyBoard::default(), hear).unwrap();
    let mut say = |told: Told<'_>| {
        let Told::Line(line) = told else { return };
        if line == "Playing" {
            clock.wake_late(late);
        }
        if !line.contains(' ') {
            states.borrow_mut().push(line.to_owned());
        }
    };
    let ended = ports::follow(
        &receiver,
        1500,
        (&map, &JointNames::ids(&map)),
        bus,
        &clock,
        &AtomicUsize::new(0),
        &mut say,
    );
    let error = ended.unwrap().0.failed.unwrap();
    Followed { told: told.take(), states: states.take(), error }
}

#[test]
fn frames_that_jump_do_not_move_servos_faster_than_they_may_and_silence_holds() {
    let Followed { told, states, error } = follow(Duration::ZERO);
    assert!(error.contains("the link is lost"), "{error}");
    assert!(states.iter().filter(|state| *state != "Stopping").eq(&STATES), "{states:?}");
    within_limits(&told);
    // It came to both ends, and is held where it was sent last.
    for end in ENDS {
        assert!(told.contains(&i32::from(end)), "{told:?}");
    }
    assert!(told.iter().rev().take(10).all(|&goal| goal == i32::from(ENDS[1])), "{told:?}");
}

/// Ticks are 20 ms apart, so a machine that is 15 ms late is in time, and one that is 25 ms late is not.
#[test]
fn a_machine_that_is_too_slow_is_a_fault_and_one_that_is_just_fast_enough_is_none() {
    assert!(follow(Duration::from_millis(15)).error.contains("the link is lost"));
    let Followed { told, states, error } = follow(Duration::from_millis(25));
    assert!(error.contains("ticks come too late"), "{error}");
    // The buses took no time, so it is the computer: the first late tick by 25 ms, and those behind it by 5 ms more each.
    let (_, latest) = error.split_once("the latest ").unwrap();
    let latest: f64 = latest.split_once(" ms after its own time").unwrap().0.parse().unwrap();
    assert!((30.0..=60.0).contains(&latest), "{error}");
    assert!(error.contains("a tick has 20.0 ms") && error.contains("this computer was busy"), "{error}");
    assert!(states.iter().filter(|state| *state != "Stopping").eq(&STATES), "{states:?}");
    within_limits(&told);
}

/// A process that does not outlive the test, and the first line that it prints.
struct Process(Child, String);

impl Process {
    fn start(arguments: &[&str]) -> Self {
        let mut process =
            bunraku().args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        Self(process, line.trim().to_owned())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The commands on pseudo terminals, by this machine's clock. A machine that is busy may be too late, which the player must say;
/// nothing else may go wrong then.
#[test]
fn real_time_is_followed_or_is_said_to_be_too_fast() {
    let folder = tempfile::tempdir().unwrap();
    let (log, own, puppet) = (folder.path().join("told.csv"), folder.path().join("own.csv"), puppet());
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let servos = Process::start(&["servos", "--config", &text(&puppet), "--log", &text(&log)]);
    let arguments =
        ["follow", &text(&puppet), "--from", "pty", "--lost", "1.5", "--on", &servos.1, "--log", &text(&own)];
    let mut player = Process::start(&arguments);
    let mut line = File::options().write(true).open(&player.1).unwrap();
    let mut said = BufReader::new(player.0.stderr.take().unwrap());
    let mut text = String::new();
    while !text.ends_with("Opening\n") && said.read_line(&mut text).unwrap() > 0 {
        line.write_all(&NOISE).unwrap();
    }
    let (open, mut frames, mut longest) = (Instant::now(), 0, Duration::ZERO);
    let mut last = open;
    // A player that has found its machine too slow is gone.
    while open.elapsed() < JUMPING && line.write_all(&sent(open.elapsed())).is_ok() {
        frames += 1;
        longest = longest.max(last.elapsed());
        last = Instant::now();
        sleep(Duration::from_millis(10));
    }
    said.read_to_string(&mut text).unwrap();
    assert_eq!(player.0.wait().unwrap().code(), Some(1), "{text}");
    let late = ["ticks come too late", "did not answer in time"].iter().any(|why| text.contains(why));
    println!(
        "measured: {frames} frames sent in {:.2} s, at most {longest:?} apart; the machine was {}",
        open.elapsed().as_secs_f64(),
        if late { "too late" } else { "in time" }
    );
    let states = text.lines().filter(|line| !line.contains(' ') && *line != "Stopping");
    if late {
        assert!(
            states.zip(STATES).all(|(state, expected)| state == expected || state == "Holding"),
            "{text}"
        );
    } else {
        assert!(text.contains("the link is lost") && states.eq(STATES), "{text}");
    }
    // The player's own log is kept, though it has failed.
    let own = fs::read_to_string(own).unwrap();
    assert!(own.lines().filter(|row| row.contains(&format!(",bus,{HEAD},"))).count() > 100, "{own}");
    let told = fs::read_to_string(log).unwrap();
    let goals = told.lines().filter_map(|line| line.split_once(&format!(",bus,{HEAD},"))?.1.parse().ok());
    let goals: Vec<i32> = goals.collect();
    if late {
        // Of goals that come too late some may be missing, so that steps are longer; but all lie on the way.
        let [low, high] = ENDS.map(i32::from);
        assert!(goals.iter().all(|goal| (low..=high).contains(goal)), "{goals:?}");
    } else {
        within_limits(&goals);
    }
}

/// A bus that breaks in the middle of a clip: what was told until then is there.
#[test]
fn what_was_told_until_a_fault_is_kept() {
    let puppet = Puppet::read(&workspace().join("puppets/sample.toml")).unwrap();
    let sample = mocap::sample::clip();
    let map = puppet.map(&sample.skeleton).unwrap();
    let bytes =
        encoder::qmd::encode(&sample, encoder::qmd::Parameters::TABLE_1, encoder::qmd::Method::ClosedLoop)
            .unwrap();
    let clip = Clip::parse(Path::new("walk.qmd"), &bytes).unwrap();
    let joints = map.joints().iter();
    let servos = joints.map(|joint| ServoConfig { position: joint.zero, ..ServoConfig::new(joint.id) });
    let mut servos =
        DynamixelServos::new(&DynamixelConfig { servos: servos.collect(), ..DynamixelConfig::with_ids(&[]) })
            .unwrap();
    servos.schedule(6_000_000, Disturbance::Cut { seconds: 600.0 }).unwrap();
    let clock = SimulatedClock::new(|_| {});
    let hear = |bytes: &[u8]| servos.receive(bytes, clock.now().as_micros() as u64, &mut |_| {});
    let bus = virtual_bus(&map, &HobbyBoard::default(), hear).unwrap();
    let performance = Performance::of(&clip, 0);
    let played = ports::play(&performance, &map, bus, &clock, &AtomicUsize::new(0), &mut |_| {}).unwrap();
    assert!(played.failed.is_some(), "{:?}", played.state);
    // From some tenths of a second on, in which servos are found, at 50 Hz.
    let ticks = played.recording.goals.len() / map.joints().len();
    assert!((200..=310).contains(&ticks), "{ticks}");
    assert_eq!(played.recording.present.len(), ticks);
}
