//! Clients that we did not write drive the virtual servos of `bunraku servos`.
//!
//! Needs the command `bunraku` and, for the clients, a Python with the packages of `tests/peers/requirements.txt`.

use bunraku_tests::{bunraku, python, workspace};
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};

/// The text of a puppet whose joints have these ids, and these ranges in goal units.
fn text(servos: impl IntoIterator<Item = (u8, &'static str)>) -> String {
    let joint = |(id, range)| {
        format!(
            "[[joint]]\nname = '{id}'\nchannel = 'a.rx'\nid = {id}\ngoal_range = [{range}]\nmax_speed = 90\n"
        )
    };
    "servo_hz = 50\nbaud = 57600\n".to_owned() + &servos.into_iter().map(joint).collect::<String>()
}

/// `bunraku servos`, stopped when dropped.
struct Servos {
    process: Child,
    port: String,
    _folder: tempfile::TempDir,
}

impl Servos {
    fn start(listen: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let puppet = folder.path().join("puppet.toml");
        let text = text([(1, "0, 4095"), (2, "0, 4095"), (3, "1000, 3000"), (20, "0, 4095")]);
        std::fs::write(&puppet, text).expect("write the puppet");
        let mut process = bunraku()
            .args(["servos", "--config"])
            .arg(&puppet)
            .args(["--listen", listen])
            .stdout(Stdio::piped())
            .spawn()
            .expect("run bunraku servos");
        let mut port = String::new();
        let stdout = process.stdout.take().expect("piped above");
        BufReader::new(stdout).read_line(&mut port).expect("the port on stdout");
        Self { process, port: port.trim().to_owned(), _folder: folder }
    }
}

impl Drop for Servos {
    fn drop(&mut self) {
        self.process.kill().and_then(|()| self.process.wait().map(|_| ())).expect("stop bunraku servos");
    }
}

fn peer(script: &str) {
    let Some(python) = python() else { return };
    let servos = Servos::start("pty");
    let script = workspace().join("tests/peers").join(script);
    let output = Command::new(python).arg(script).arg(&servos.port).output().expect("run the peer");
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{out}{err}");
    print!("{out}");
}

#[test]
fn dynamixel_sdk_drives_the_servos() {
    peer("servos_sdk.py");
}

#[test]
fn rustypot_drives_the_servos() {
    peer("servos_rustypot.py");
}

#[test]
fn a_packet_over_tcp_is_answered() {
    let servos = Servos::start("tcp:127.0.0.1:0");
    let mut client = std::net::TcpStream::connect(&servos.port).expect("the port that was printed");
    // The e-Manual's read of Present Position; a servo starts at the middle of its turn, 2048.
    client
        .write_all(&[0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x07, 0x00, 0x02, 0x84, 0x00, 0x04, 0x00, 0x1D, 0x15])
        .unwrap();
    let mut answer = [0; 15];
    client.read_exact(&mut answer).unwrap();
    assert_eq!(answer[4..13], [0x01, 0x08, 0x00, 0x55, 0x00, 0x00, 0x08, 0x00, 0x00]);
}

#[test]
fn errors_are_sentences_and_exit_codes() {
    let folder = tempfile::tempdir().unwrap();
    let puppet = folder.path().join("puppet.toml");
    let run = |text: &str, listen: &str| {
        std::fs::write(&puppet, text).unwrap();
        let output =
            bunraku().args(["servos", "--listen", listen, "--config"]).arg(&puppet).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, error) = run(&text([(4, "0, 4095"), (4, "0, 4095")]), "pty");
    assert_eq!(code, Some(1));
    assert!(error.contains("puppet.toml does not describe servos: servo id 4 is used twice"), "{error}");
    let (code, error) = run("[[joint]]\nid = x\n", "pty");
    assert_eq!(code, Some(1));
    assert!(error.contains("puppet.toml") && error.contains("line 2"), "{error}");
    let (code, error) = run(&text([(4, "0, 4095")]), "com1");
    assert_eq!(code, Some(2));
    assert!(error.contains("expected pty or tcp:HOST:PORT"), "{error}");
}
