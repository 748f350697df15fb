//! The command `device`: who may connect, and which file is its flash.

use bunraku_tests::{bunraku, workspace};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

fn device(arguments: &[&str]) -> Command {
    let mut command = bunraku();
    command.arg("device").arg("--puppet").arg(workspace().join("puppets/figure-6.toml")).args(arguments);
    command
}

/// Ends when the test does.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A device that runs, and its port.
fn start(arguments: &[&str]) -> (Running, String) {
    let mut running =
        Running(device(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap());
    let mut line = String::new();
    BufReader::new(running.0.stdout.take().unwrap()).read_line(&mut line).unwrap();
    (running, line.trim().to_owned())
}

fn refused(arguments: &[&str], expected: &str) {
    let output = device(arguments).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0), "{said}");
    assert!(said.lines().count() == 1 && said.contains(expected), "{expected:?} is not in {said:?}");
}

#[test]
fn a_device_that_others_reach_needs_a_key_or_a_word() {
    refused(&["--listen", "tcp:0.0.0.0:0"], "give hosts a key (--key-file FILE)");
    let (mut running, _) = start(&["--listen", "tcp:0.0.0.0:0", "--without-key"]);
    let mut warning = String::new();
    BufReader::new(running.0.stderr.take().unwrap()).read_line(&mut warning).unwrap();
    assert!(warning.starts_with("warning: whoever reaches tcp:0.0.0.0:"), "{warning}");
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let (right, wrong) = (write("right", "0123456789abcdef\n"), write("wrong", "0123456789abcdee\n"));
    refused(&["--key-file", &write("short", "0123\n")], "the key has 4 bytes, expected 16 to 64");
    let (_running, port) = start(&["--listen", "tcp:127.0.0.1:0", "--key-file", &right]);
    for (key, expected) in [
        (None, Some("needs a key: name the file that has it with --key-file")),
        (Some(&wrong), Some("the key is not the device's")),
        (Some(&right), None),
    ] {
        let mut command = bunraku();
        command.args(["push", &port, "stop"]);
        if let Some(key) = key {
            command.args(["--key-file", key]);
        }
        let output = command.output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.success(), expected.is_none(), "{said}");
        assert!(expected.is_none_or(|expected| said.contains(expected)), "{said}");
    }
}

#[test]
fn a_flash_file_is_one_devices_and_nothing_else_is_written_to() {
    let folder = tempfile::tempdir().unwrap();
    let flash = folder.path().join("puppet.flash").display().to_string();
    let arguments = ["--listen", "tcp:127.0.0.1:0", "--flash", &flash];
    let (running, _) = start(&arguments);
    refused(&arguments, "another device keeps its flash in");
    drop(running);
    let (_running, _) = start(&arguments);
    let clip = folder.path().join("clip.mclip");
    std::fs::write(&clip, b"MCLP and what follows").unwrap();
    let name = clip.display().to_string();
    refused(&["--listen", "tcp:127.0.0.1:0", "--flash", &name], "is no device's flash");
    assert_eq!(std::fs::read(&clip).unwrap(), b"MCLP and what follows");
}
