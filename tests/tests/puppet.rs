//! `bunraku puppet` and `bunraku play --on PORT`, on virtual servos behind a pseudo terminal.
#![allow(clippy::unwrap_used)]
#![cfg(unix)]

use bunraku_tests::clock::SimulatedClock;
use bunraku_tests::{bunraku, workspace};
use firmware::machine::State;
use host_sim::clip::Clip;
use host_sim::play::Performance;
use host_sim::ports;
use mocap::sample;
use puppet_file::Puppet;
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::AtomicUsize;
use std::thread::sleep;
use std::time::Duration;

/// Virtual servos in a process of their own.
struct Servos {
    process: Child,
    port: String,
}

impl Servos {
    fn start(puppet: &Path, more: &[(&str, &Path)]) -> Self {
        let mut command = bunraku();
        command.arg("servos").arg("--config").arg(puppet).stdout(Stdio::piped());
        more.iter().for_each(|(flag, path)| {
            command.arg(flag).arg(path);
        });
        let mut process = command.spawn().unwrap();
        let mut port = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut port).unwrap();
        Self { process, port: port.trim().to_owned() }
    }
}

impl Drop for Servos {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The sample's puppet with its skeleton beside it.
fn puppet(folder: &Path) -> PathBuf {
    puppet_of(folder, "sample.toml")
}

/// One of puppets/ for the sample, with its skeleton beside it.
fn puppet_of(folder: &Path, name: &str) -> PathBuf {
    fs::write(folder.join("sample.asf"), sample::asf()).unwrap();
    let text = fs::read_to_string(workspace().join("puppets").join(name)).unwrap();
    let path = folder.join("puppet.toml");
    fs::write(&path, format!("skeleton = \"sample.asf\"\n{text}")).unwrap();
    path
}

fn clip(folder: &Path) -> PathBuf {
    let (motion, clip) = (folder.join("sample.amc"), folder.join("sample.mclip"));
    let motion_of = sample::clip();
    let mut amc = Vec::new();
    let rotations = mocap::export::amc::Rotations::AsTheyAre;
    mocap::export::amc::write(&mut amc, &motion_of.skeleton, &motion_of.motion, rotations).unwrap();
    fs::write(&motion, amc).unwrap();
    let mut encode = bunraku();
    encode.arg("encode").arg(&motion).arg("--skeleton").arg(folder.join("sample.asf"));
    let done = encode.args(["--codec", "dpcm", "-o"]).arg(&clip).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    clip
}

/// Exit code, standard output and standard error.
fn run(command: &mut Command) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = command.output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

fn sub(command: &str) -> Command {
    let mut bunraku = bunraku();
    bunraku.args(["puppet", command]);
    bunraku
}

#[test]
fn check_tells_ranges_and_times_and_what_a_clip_asks() {
    let folder = tempfile::tempdir().unwrap();
    let (puppet, clip) = (puppet(folder.path()), clip(folder.path()));
    let check = || {
        let mut check = sub("check");
        check.arg(&puppet).arg("--clip").arg(&clip);
        check
    };
    let (code, text, error) = run(&mut check());
    assert_eq!(code, Some(0), "{error}");
    // Twelve servos: 74 + 26 bytes out, 8 + 12 · 16 back.
    assert!(text.contains("a tick is 300 bytes (74 goals, 26 questions, 200 answers), 3000 µs"), "{text}");
    let (code, json, _) = run(check().arg("--json"));
    let report: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (code, report["highest_hz"].as_u64(), report["joints"].as_array().unwrap().len()),
        (Some(0), Some(333), 12)
    );
    // The same clip on a puppet that is slow and stiff.
    let slow = fs::read_to_string(&puppet).unwrap().replace("max_speed = ", "max_speed = 1 #");
    fs::write(&puppet, slow).unwrap();
    let (code, text, _) = run(&mut check());
    assert!(code == Some(0) && text.contains("too fast in "), "{text}");
    // A bus that is too slow is a mistake.
    let text = fs::read_to_string(&puppet).unwrap().replace("baud = 1_000_000", "baud = 57_600");
    fs::write(&puppet, text).unwrap();
    let (code, text, _) = run(&mut check());
    assert!(code == Some(1) && text.contains("too much"), "{text}");
}

#[test]
fn check_tells_all_mistakes() {
    let folder = tempfile::tempdir().unwrap();
    let puppet = puppet(folder.path());
    let text =
        fs::read_to_string(&puppet).unwrap().replace("rtibia.rx", "rshin.rx").replace("id = 3\n", "id = 4\n");
    fs::write(&puppet, text).unwrap();
    let (code, _, error) = run(sub("check").arg(&puppet));
    assert_eq!((code, error.lines().count()), (Some(1), 2), "{error}");
    assert!(error.contains("has id 4 as well") && error.contains("no joint \"rshin\""), "{error}");
}

/// Mistakes of every sort in one file, each with its line, in the order of the file.
#[test]
fn check_tells_every_mistake_with_its_line() {
    let text = "servo_hz = 0\nease_seconds = 99\nease_speed = 0\nbaud = 1_000_000\ncolour = 'red'\n\
        [[chain]]\nname = 'arm'\nbone = 'right upper arm'\nagainst = 'chest'\n\
        [[joint]]\nname = 'one'\nchain = 'arm'\naxis = 'x'\nid = 255\nrange = [-30, 10, 30, 40]\nmax_speed = 450\n\
        [[joint]]\nname = 'two'\nchain = 'arm'\naxis = '-x'\nid = 2\nrange = [nan, 0]\nmax_speed = 450\n\
        [[joint]]\nname = \"thr\\u001bee\"\nchannel = 'head.ry'\nid = 2\nrange = [10, 10]\nmax_speed = 0\n\
        [[joint]]\nname = 'four'\nchannel = 'head.ry'\nid = 300\nrange = [100, 200]\nmax_acceleration = 1e-308\n\
        sum = [{ bone = 'head', against = 'chest', axis = 'x', weight = 0 }]\n\
        [[joint]]\nname = 'four'\nid = 6\nchannel = 'head.rx'\nrange = [-10, 10]\nmax_speed = 'fast'\ndirection = 7\n\
        home = 40\nmodel = 'XM431'\nscale = -1\n";
    let expected = [
        (1, "servo_hz", "found 0, expected 1 to 1000"),
        (2, "ease_seconds", "found 99, expected 0 to 60"),
        (3, "ease_speed", "found 0, expected 0.004 to 1"),
        (5, "colour", "unknown field `colour`"),
        (14, "id", "found 255, expected 0 to 252"),
        (15, "range", "found 4 numbers, expected two"),
        (20, "axis", "the axis is that of \"one\" before it"),
        (22, "range", "found NaN, expected a number"),
        (25, "name", "found a control character"),
        (27, "id", "joint \"two\" has id 2 as well"),
        (28, "range", "found 10 twice"),
        (29, "max_speed", "found 0, expected more than 0"),
        (30, "", "missing field `max_speed`"),
        (31, "name", "expected one of `channel`, `turn`, `chain` and `sum`"),
        (33, "id", "invalid value: integer `300`"),
        (34, "range", "these are goals 3186 to 4324"),
        (35, "max_acceleration", "too little for a servo"),
        (36, "sum", "found 0, with which the turn counts for nothing"),
        (38, "name", "another joint has this name"),
        (42, "max_speed", "invalid type: string \"fast\""),
        (43, "direction", "found 7, expected 1 or -1"),
        (45, "model", "the model \"XM431\" is not known"),
        (46, "scale", "found -1, expected more than 0"),
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wrong.toml");
    fs::write(&path, text).unwrap();
    let (code, _, error) = run(sub("check").arg(&path));
    assert_eq!(code, Some(1));
    let said: Vec<&str> = error.lines().collect();
    for (line, key, sentence) in expected {
        let place = match key {
            "" => format!("wrong.toml, line {line}: "),
            key => format!("wrong.toml, line {line}, key \"{key}\": "),
        };
        let is = |said: &&&str| said.contains(&format!("{place}{sentence}"));
        assert_eq!(said.iter().filter(is).count(), 1, "{place}{sentence} is not once in {error}");
    }
    assert_eq!(said.len(), expected.len(), "{error}");
}

#[test]
fn long_names_and_clips_for_other_puppets_are_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("puppet.toml");
    let joint = |name: &str, id: u8, follows: &str| {
        format!("[[joint]]\nname = '{name}'\nid = {id}\n{follows}\nrange = [-10, 10]\nmax_speed = 100\n")
    };
    let head = "servo_hz = 50\nbaud = 1_000_000\n";
    fs::write(&path, format!("{head}{}", joint(&"n".repeat(65_536), 1, "channel = 'head.ry'"))).unwrap();
    let (code, _, error) = run(sub("check").arg(&path));
    assert!(code == Some(1) && error.contains("line 4, key \"name\": found 65536"), "{error}");
    assert!(error.len() < 400, "{} bytes", error.len());
    let turn = "turn = { bone = 'head', against = 'chest', axis = 'y' }";
    fs::write(&path, format!("{head}{}{}", joint("one", 1, turn), joint("two", 2, turn))).unwrap();
    fs::write(folder.path().join("sample.asf"), sample::asf()).unwrap();
    let clip = clip(folder.path());
    let (code, _, error) = run(sub("check").arg(&path).arg("--clip").arg(&clip));
    assert_eq!((code, error.matches("was not made for this puppet").count()), (Some(1), 1), "{error}");
}

#[test]
fn scan_finds_who_is_there_and_who_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let puppet = puppet(folder.path());
    let servos = Servos::start(&puppet, &[]);
    let scan = |more: &[&str]| {
        let mut scan = sub("scan");
        scan.args(["--on", &servos.port]).args(more);
        run(&mut scan)
    };
    let path = puppet.to_str().unwrap();
    let (code, json, error) = scan(&["--json", "--puppet", path]);
    assert_eq!(code, Some(0), "{json}{error}");
    let report: Value = serde_json::from_str(&json).unwrap();
    let found = report["servos"].as_array().unwrap();
    assert_eq!(found.len(), 12);
    assert_eq!((&found[0]["model_name"], &found[0]["position"]), (&"XM430-W350".into(), &2048.into()));
    assert_eq!((&found[0]["torque"], &found[0]["celsius"]), (&false.into(), &30.into()));
    let text = fs::read_to_string(&puppet).unwrap();
    let other =
        text.replacen("id = 3\n", "id = 77\n", 1).replacen("id = 4\n", "id = 4\nmodel = 'XL430-W250'\n", 1);
    fs::write(&puppet, other).unwrap();
    let (code, text, _) = scan(&["--puppet", path]);
    assert_eq!(code, Some(1), "{text}");
    for expected in ["servo 77 (\"", "does not answer", "is XM430-W350, expected XL430-W250", "with the id 3"]
    {
        assert!(text.contains(expected), "{expected:?} is not in {text}");
    }
    let (code, text, _) = scan(&["--baud", "1000000", "--ids", "5-6"]);
    assert_eq!((code, text.lines().count()), (Some(0), 3), "{text}");
    let (code, _, error) = run(sub("scan").args(["--on", "/dev/no-such-port"]));
    assert!(code == Some(1) && error.contains("cannot open /dev/no-such-port"), "{error}");
}

#[test]
fn calibrate_writes_where_joints_were_held() {
    let said = calibrates("sample.toml", 3, 2100, 1500, 2500);
    assert!(!said.contains("wider"), "{said}");
    // The file has 683 to 2731.
    let said = calibrates("sample.toml", 3, 2100, 600, 2500);
    assert!(said.contains("wider than the range that the file has, 683 to 2731"), "{said}");
}

#[test]
fn calibrate_measures_an_ax() {
    calibrates("sample-buses.toml", 1, 500, 300, 700);
}

#[test]
fn calibrate_measures_an_sts() {
    calibrates("sample-buses.toml", 2, 2100, 1500, 2500);
}

#[test]
fn calibrate_measures_an_scs() {
    calibrates("sample-buses.toml", 3, 600, 300, 900);
}

/// Holds a servo at its zero, turns it to both ends by hand, and looks for that in the puppet. What else was said.
fn calibrates(name: &str, servo: u8, zero: i32, low: i32, high: i32) -> String {
    let folder = tempfile::tempdir().unwrap();
    let puppet = puppet_of(folder.path(), name);
    let events = folder.path().join("hand.toml");
    let turn = |at: f64, position: i32| {
        format!("[[event]]\nat = {at}\nwhat = 'turn'\nservo = {servo}\nposition = {position}\n")
    };
    // In the right order with time to spare on a busy machine.
    fs::write(&events, [turn(0.0, zero), turn(5.0, low), turn(5.5, high), turn(6.0, zero)].concat()).unwrap();
    let servos = Servos::start(&puppet, &[("--events", &events)]);
    let before = fs::read_to_string(&puppet).unwrap();
    let name = before.split(&format!("id = {servo}\n")).next().unwrap().rsplit("name = \"").next().unwrap();
    let name = name.split('"').next().unwrap();
    let mut process = sub("calibrate")
        .arg(&puppet)
        .args(["--json", "--on", &servos.port, "--joint", name])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = process.stdin.take().unwrap();
    let mut said = BufReader::new(process.stderr.take().unwrap());
    let mut line = String::new();
    for expected in ["All torque goes off", "to its zero", &format!("its zero is {zero}")] {
        line.clear();
        said.read_line(&mut line).unwrap();
        assert!(line.contains(expected), "{line}");
        if !expected.contains("zero is") {
            stdin.write_all(b"\n").unwrap();
        }
    }
    sleep(Duration::from_secs(7));
    stdin.write_all(b"\n").unwrap();
    let mut json = String::new();
    process.stdout.take().unwrap().read_to_string(&mut json).unwrap();
    assert!(process.wait().unwrap().success());
    let report: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(report["measured"][0]["goal_range"], serde_json::json!([low, high]), "{json}");
    let after = fs::read_to_string(&puppet).unwrap();
    let written = [format!("goal_range = [{low}, {high}]"), format!("zero = {zero}")];
    assert!(written.iter().all(|line| after.contains(line)), "{after}");
    let comments = |text: &str| text.lines().filter(|line| line.starts_with('#')).count();
    assert_eq!(comments(&after), comments(&before));
    assert_eq!(run(sub("check").arg(&puppet)).0, Some(0));
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    rest
}

/// The goals of a servo in a log, where a row has more of `row` in front of its servo.
fn goals_of(log: &str, row: &str, servo: u64) -> Vec<i64> {
    let wanted = format!("{row}{servo},");
    let goals = log.lines().filter_map(|line| line.split_once(',')?.1.strip_prefix(&wanted)?.parse().ok());
    let mut goals: Vec<i64> = goals.collect();
    goals.dedup();
    goals
}

#[test]
fn four_buses_of_other_protocols_are_played_and_scanned() {
    let folder = tempfile::tempdir().unwrap();
    let (puppet, clip) = (puppet_of(folder.path(), "sample-buses.toml"), clip(folder.path()));
    // The servos turn in real time, and the player's time is simulated: for the player they stand still.
    let text = fs::read_to_string(&puppet).unwrap();
    fs::write(&puppet, text.replacen("servo_hz", "following_error = 0\nservo_hz", 1)).unwrap();
    let told = folder.path().join("told.csv");
    let servos = Servos::start(&puppet, &[("--log", &told)]);
    let ports_of_buses: Vec<&str> =
        servos.port.split(',').map(|port| port.split('=').next().unwrap()).collect();
    assert_eq!(ports_of_buses, ["ax", "sts", "scs", "hobby"]);
    // In simulated time, so that no tick is late.
    let parsed = Puppet::read(&puppet).unwrap();
    let skeleton = mocap::import::load_skeleton(&folder.path().join("sample.asf")).unwrap();
    let map = parsed.map(&skeleton).unwrap();
    let paths = ports::paths(&servos.port, &parsed.bus_names(), |_| true).unwrap();
    let buses = ports::open(&map, &paths).unwrap();
    let (clock, asked) = (SimulatedClock::new(|_| {}), AtomicUsize::new(0));
    let bytes = fs::read(&clip).unwrap();
    let parsed_clip = Clip::parse(&clip, &bytes).unwrap();
    let performance = Performance::of(&parsed_clip, 6000);
    let played = ports::play(&performance, &map, buses, &clock, &asked, &mut |_| {}).unwrap();
    assert_eq!((played.state, played.late.ticks, map.joints().len()), (State::Resting, 0, 12));
    // What was sent on each wire was understood by what is at its other end.
    let told = fs::read_to_string(&told).unwrap();
    let sent = |servo: u64| {
        let of = played.recording.goals.iter().filter(|goal| u64::from(goal.id) == servo);
        let mut goals: Vec<i64> = of.map(|goal| goal.position.into()).collect();
        goals.dedup();
        goals
    };
    for servo in 1..=12 {
        let bus = ports_of_buses[(servo as usize - 1) % 4];
        let goals = sent(servo);
        assert!(goals.len() > 20 && goals == goals_of(&told, &format!("{bus},"), servo), "{servo}");
    }
    // Those that can be read say where they were left.
    let (code, json, error) =
        run(sub("scan").args(["--json", "--ids", "1-12", "--on", &servos.port, "--puppet"]).arg(&puppet));
    assert_eq!(code, Some(0), "{json}{error}");
    let report: Value = serde_json::from_str(&json).unwrap();
    let found = report["servos"].as_array().unwrap();
    // The virtual SCS with 200 degrees has no number that is known.
    let models = ["AX-12A", "STS3215", "model 0"].map(|model| [model; 3]).concat();
    assert!(found.iter().map(|servo| servo["model_name"].as_str().unwrap()).eq(models), "{json}");
    for servo in found {
        let last = sent(servo["id"].as_u64().unwrap()).pop();
        assert_eq!((servo["position"].as_i64(), &servo["torque"]), (last, &true.into()), "{servo}");
    }
}

/// The command by this machine's clock. A machine that is busy may be too late, which the player must say, and then it says
/// nothing else.
#[test]
fn a_real_port_is_played_and_asked_to_end() {
    let folder = tempfile::tempdir().unwrap();
    let (puppet, clip) = (puppet(folder.path()), clip(folder.path()));
    let servos = Servos::start(&puppet, &[]);
    let play = || {
        let mut play = bunraku();
        play.arg("play").arg(&clip).arg("--puppet").arg(&puppet).args(["--json", "--on", &servos.port]);
        play
    };
    let late =
        |error: &str| ["ticks come too late", "did not answer in time"].iter().any(|why| error.contains(why));
    // 480 frames at 400 a second.
    let log = folder.path().join("live.csv");
    let (code, json, error) = run(play().args(["--fps", "400", "--log"]).arg(&log));
    if code == Some(0) {
        assert!(error.contains("Playing"), "{error}");
        let report: Value = serde_json::from_str(&json).unwrap();
        println!(
            "measured: {} of {} ticks late, {} ms on the bus",
            report["late_ticks"], report["ticks"], report["longest_bus_ms"]
        );
        assert_eq!(report["state"], "Resting", "{json}");
        let goals = fs::read_to_string(&log).unwrap().lines().count() - 1;
        assert_eq!(Some(goals as u64), report["goals"].as_u64());
    } else {
        println!("measured: this machine is too late: {error}");
        assert!(code == Some(1) && late(&error), "{error}");
    }
    // The servos that this player has left are found by the next one, which is interrupted as it plays.
    let mut process = play().stderr(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(process.stderr.take().unwrap());
    let mut text = String::new();
    while !text.ends_with("Playing\n") && said.read_line(&mut text).unwrap() > 0 {}
    // On its way, so that it has to brake.
    sleep(Duration::from_millis(700));
    let _ = Command::new("kill").args(["-INT", &process.id().to_string()]).status().unwrap();
    let (mut rest, mut json) = (String::new(), String::new());
    said.read_to_string(&mut rest).unwrap();
    process.stdout.take().unwrap().read_to_string(&mut json).unwrap();
    if !process.wait().unwrap().success() {
        println!("measured: this machine is too late: {text}{rest}");
        assert!(late(&rest) || late(&text), "{text}{rest}");
        return;
    }
    let states: Vec<&str> = rest.lines().filter(|line| !line.contains(' ')).collect();
    assert_eq!(states, ["Stopping", "Returning", "Resting"]);
    let report: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(report["state"], "Resting");
}
