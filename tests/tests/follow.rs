//! `bunraku follow`: live frames of the Blender add-on move virtual servos behind a pseudo terminal.
#![allow(clippy::unwrap_used)]
#![cfg(unix)]

use bunraku_tests::{bunraku, workspace};
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

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

/// As the add-on sends it.
fn frame(id: u8, position: u16) -> [u8; 5] {
    let [high, low] = position.to_be_bytes();
    [b'<', id, high, low, b'>']
}

/// The servo that is moved, and how far it goes.
const HEAD: u8 = 2;
const ENDS: [u16; 2] = [1300, 2800];

/// Follows jumps from end to end among noise, and then nothing more: what the servo was told, and what was said.
fn follow(folder: &Path) -> (Vec<i32>, Option<i32>, String) {
    let (log, puppet) = (folder.join("told.csv"), workspace().join("puppets/sample.toml"));
    let [log, puppet] = [&log, &puppet].map(|path| path.to_str().unwrap());
    let servos = Process::start(&["servos", "--config", puppet, "--log", log]);
    let arguments = ["follow", "--puppet", puppet, "--from", "pty", "--lost", "1.5"];
    let mut player = Process::start(&[&arguments[..], &["--on", &servos.1]].concat());
    let mut line = File::options().write(true).open(&player.1).unwrap();
    let mut said = BufReader::new(player.0.stderr.take().unwrap());
    let mut text = String::new();
    // It waits for somebody to send, whatever noise there is, and goes to the first pose.
    while !text.ends_with("Opening\n") && said.read_line(&mut text).unwrap() > 0 {
        line.write_all(b"<<\x02>").unwrap();
    }
    let easing = Instant::now();
    while easing.elapsed() < Duration::from_secs(6) {
        let end = ENDS[usize::from(easing.elapsed().as_millis() / 1000 % 2 == 1)];
        // Half a frame and bytes that are none, and a frame for somebody else, in between.
        let noise = [&frame(HEAD, end)[..3], b"\x00\x01", &frame(200, 7)].concat();
        // A player that has found its machine too slow is gone.
        if line.write_all(&[&noise[..], &frame(HEAD, end)].concat()).is_err() {
            break;
        }
        sleep(Duration::from_millis(10));
    }
    said.read_to_string(&mut text).unwrap();
    let code = player.0.wait().unwrap().code();
    let told = fs::read_to_string(log).unwrap();
    let goals = told.lines().filter_map(|line| line.split_once(&format!(",bus,{HEAD},"))?.1.parse().ok());
    (goals.collect(), code, text)
}

#[test]
fn frames_that_jump_do_not_move_servos_faster_than_they_may_and_silence_holds() {
    // A machine that is busy with other tests may be too late, which a player must not bear.
    let (told, code, text) = (0..5)
        .map(|_| follow(tempfile::tempdir().unwrap().path()))
        .find(|(.., text)| !text.contains("in time") && !text.contains("too late"))
        .expect("the machine is in time once");
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("the link is lost"), "{text}");
    let states: Vec<&str> = text.lines().filter(|line| !line.contains(' ')).collect();
    let expected = ["Finding", "Reading", "Arming", "Opening", "Easing", "Playing", "Holding"];
    assert!(states.iter().filter(|state| **state != "Stopping").eq(&expected), "{text}");
    // From where it is; 450 degrees a second, reached in 50 ms, at 50 Hz: 102.4 goal units a tick, and 41 more or fewer than before.
    assert_eq!(told[0], 2048);
    for three in told.windows(3) {
        let (before, after) = (three[1] - three[0], three[2] - three[1]);
        assert!(after.abs() <= 103 && (after - before).abs() <= 42, "{three:?}");
    }
    // It came to both ends, and is held where it was sent last.
    for end in ENDS {
        assert!(told.contains(&i32::from(end)), "{told:?}");
    }
    assert!(told.iter().rev().take(10).all(|&goal| goal == i32::from(ENDS[1])), "{told:?}");
}
