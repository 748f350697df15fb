//! `bunraku follow --listen`, told by a client that sends what the Blender add-on Servo Animation sends: over its WebSocket, and over
//! TCP, byte by byte as RFC 6455 and the add-on's source have it (`addon/utils/live_mode.py`), with no code of ours.
#![allow(clippy::unwrap_used)]

use bunraku_tests::clock::SimulatedClock;
use bunraku_tests::{bunraku, workspace};
use firmware::follow::Counters;
use host_sim::live_frames::Listener;
use host_sim::ports::{self, Clock, InstantClock, Played, Told, virtual_buses};
use host_sim::puppet::joint_names::JointNames;
use host_sim::puppet_servos;
use puppet_file::Puppet;
use std::cell::RefCell;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Time that anything may take on a machine that is busy.
const LONG: Duration = Duration::from_secs(60);

/// The servo that is moved, and how far it goes.
const HEAD: u8 = 2;
const ENDS: [u16; 2] = [1300, 2800];

/// `[0x3C, servo_id] + position.to_bytes(2, 'big') + [0x3E]`.
fn frame(id: u8, position: u16) -> Vec<u8> {
    let [high, low] = position.to_be_bytes();
    vec![0x3C, id, high, low, 0x3E]
}

/// How frames are sent.
enum Client {
    Tcp(TcpStream),
    WebSocket(TcpStream),
}

fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    stream
}

/// What the add-on's client (Python's websocket-client) sends to `ws://HOST:PORT/path`, and the answer's first line.
fn ask(address: SocketAddr, origin: &str) -> (TcpStream, String) {
    let mut stream = connect(address);
    let request = format!(
        "GET /path HTTP/1.1\r\nUpgrade: websocket\r\nHost: {address}\r\nOrigin: {origin}\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\nConnection: Upgrade\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = Vec::new();
    let mut byte = [0];
    while !answer.ends_with(b"\r\n\r\n") && stream.read(&mut byte).unwrap() == 1 {
        answer.push(byte[0]);
    }
    (stream, String::from_utf8(answer).unwrap())
}

impl Client {
    fn web_socket(address: SocketAddr) -> Self {
        let (stream, answer) = ask(address, &format!("http://{address}"));
        assert!(answer.starts_with("HTTP/1.1 101 "), "{answer}");
        // The key's answer in section 1.3 of the RFC.
        assert!(
            answer.to_lowercase().contains("sec-websocket-accept: s3pplmbitxaq9kygzzhzrbk+xoo="),
            "{answer}"
        );
        Self::WebSocket(stream)
    }

    /// Sends a message: over a WebSocket as one frame, masked as a client's must be (section 5.2).
    fn send(&mut self, bytes: &[u8]) {
        match self {
            Self::Tcp(stream) => stream.write_all(bytes).unwrap(),
            Self::WebSocket(stream) => stream.write_all(&masked(0x82, bytes)).unwrap(),
        }
    }

    /// Hangs up; over a WebSocket as the add-on does, which waits for the answer to its close.
    fn close(self) {
        match self {
            Self::Tcp(stream) => stream.shutdown(Shutdown::Both).unwrap(),
            Self::WebSocket(mut stream) => {
                stream.write_all(&masked(0x88, &1000_u16.to_be_bytes())).unwrap();
                let mut answer = [0; 4];
                stream.read_exact(&mut answer).unwrap();
                assert_eq!(answer, [0x88, 2, 0x03, 0xE8]);
            }
        }
    }
}

fn masked(first: u8, bytes: &[u8]) -> Vec<u8> {
    const MASK: [u8; 4] = [0x37, 0xFA, 0x21, 0x3D];
    assert!(bytes.len() < 126);
    let mut frame = vec![first, 0x80 | bytes.len() as u8];
    frame.extend(MASK);
    frame.extend(bytes.iter().zip(MASK.iter().cycle()).map(|(byte, mask)| byte ^ mask));
    frame
}

fn listener() -> (SocketAddr, Receiver<Vec<u8>>) {
    let listener = Listener::bind("127.0.0.1:0".parse().unwrap()).unwrap();
    (listener.address().unwrap(), listener.start(|line| println!("{line}")))
}

/// What a player came to that was told `sent` in each of 6 s of simulated time, from the moment on in which it was open for frames.
fn follow(
    puppet: &str,
    servo: u8,
    ends: [u16; 2],
    client: fn(SocketAddr) -> Client,
) -> (Played, Counters, Vec<String>) {
    let (address, received) = listener();
    let client = RefCell::new(client(address));
    let path = workspace().join("puppets").join(puppet);
    let puppet = Puppet::read(&path).unwrap();
    let map = puppet.map(puppet.channels().unwrap()).unwrap();
    let (states, open) = (RefCell::new(Vec::<String>::new()), RefCell::new(None));
    let (passed_on, input) = channel();
    let clock = SimulatedClock::new(|now| {
        if open.borrow().is_none() && states.borrow().iter().any(|state| state == "Opening") {
            *open.borrow_mut() = Some(now);
        }
        let Some(since) = open.borrow().map(|open| now - open) else { return };
        if since >= Duration::from_secs(6) {
            return;
        }
        let end = ends[usize::from(since.as_secs() % 2 == 1)];
        // Half a frame, bytes that are none, a frame for nobody, and one for the servo.
        let messages =
            [frame(servo, end)[..3].to_vec(), b"\x00\x01".to_vec(), frame(200, 7), frame(servo, end)];
        let mut missing = 0;
        for message in &messages {
            client.borrow_mut().send(message);
            missing += message.len();
        }
        // Simulated time waits for what is on its way in real time.
        while missing > 0 {
            let bytes: Vec<u8> = received.recv_timeout(LONG).unwrap();
            missing -= bytes.len();
            passed_on.send(bytes).unwrap();
        }
    });
    let now = || clock.now();
    let buses = virtual_buses::open(&map, &puppet_servos::read(&path).unwrap(), &now).unwrap();
    let mut say = |told: Told<'_>| {
        if let Told::Line(line) = told {
            states.borrow_mut().push(line.to_owned());
        }
    };
    let (played, counters) = ports::follow(
        &input,
        1500,
        (&map, &JointNames::ids(&map)),
        buses,
        &clock,
        &AtomicUsize::new(0),
        &mut say,
    )
    .unwrap();
    client.into_inner().close();
    (played, counters, states.into_inner())
}

#[test]
fn the_add_ons_frames_move_servos_of_every_bus_by_either_way() {
    // A Dynamixel X, an STS, an AX, a servo behind frames that go out again, and one on a PCA9685.
    for (puppet, servo, ends, client) in [
        ("sample.toml", HEAD, ENDS, (|address| Client::Tcp(connect(address))) as fn(SocketAddr) -> Client),
        ("sample.toml", HEAD, ENDS, Client::web_socket),
        ("sample-buses.toml", HEAD, ENDS, Client::web_socket),
        ("sample-buses.toml", 1, [430, 600], Client::web_socket),
        ("sample-buses.toml", 4, [1000, 2300], Client::web_socket),
        ("hobby.toml", 8, [1000, 2300], Client::web_socket),
    ] {
        let (played, counters, said) = follow(puppet, servo, ends, client);
        assert_eq!(played.failed.as_deref(), Some("the link is lost"), "{puppet}: {said:?}");
        // 600 steps of 10 ms.
        assert_eq!((counters.frames, counters.foreign), (600, 600), "{puppet}");
        assert_eq!(counters.skipped(), 600 * 5, "{puppet}");
        for expected in ["no frame, and are skipped", "ids that the puppet does not have"] {
            let times = said.iter().filter(|line| line.contains(expected)).count();
            assert_eq!(times, 1, "{puppet}: {said:?}");
        }
        let goals = played.recording.goals.iter().filter(|goal| goal.id == servo);
        let goals: Vec<i32> = goals.map(|goal| goal.position).collect();
        for end in ends {
            assert!(goals.contains(&i32::from(end)), "{puppet} {servo}: {goals:?}");
        }
        // It is held where it was sent last.
        assert!(goals.iter().rev().take(10).all(|&goal| goal == i32::from(ends[1])), "{puppet}: {goals:?}");
    }
}

/// Waits until a line with this in it is said.
fn wait_for(said: &mut impl BufRead, expected: &str) -> String {
    let mut all = String::new();
    while !all.lines().last().is_some_and(|line| line.contains(expected)) {
        assert!(said.read_line(&mut all).unwrap() > 0, "{expected:?} was not said: {all}");
    }
    all
}

/// A process that does not outlive the test.
struct Follower(Child);

impl Drop for Follower {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn one_client_at_a_time_is_followed_and_the_next_when_it_is_gone() {
    let mut follower = Follower(
        bunraku()
            .arg("follow")
            .arg(workspace().join("puppets/sample-buses.toml"))
            .args(["--listen", "127.0.0.1:0", "--lost", "0"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap(),
    );
    let mut line = String::new();
    BufReader::new(follower.0.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address: SocketAddr = line.trim().parse().unwrap();
    let mut said = BufReader::new(follower.0.stderr.take().unwrap());
    wait_for(&mut said, &format!("method Web Socket, host 127.0.0.1, port {}", address.port()));
    // A page in a browser, which says where it is from, is none of ours.
    let (_, answer) = ask(address, "http://example.com");
    assert!(answer.starts_with("HTTP/1.1 403 "), "{answer}");
    wait_for(&mut said, "is a page of another origin, and was refused");
    let mut first = Client::web_socket(address);
    wait_for(&mut said, "is connected by WebSocket");
    // Others are told why they are not followed, each in its own words.
    let (mut second, answer) = ask(address, &format!("http://{address}"));
    assert!(answer.starts_with("HTTP/1.1 503 "), "{answer}");
    let mut why = String::new();
    second.read_to_string(&mut why).unwrap();
    assert!(why.contains("is connected already"), "{why}");
    let mut third = connect(address);
    third.write_all(&frame(HEAD, 2000)).unwrap();
    why.clear();
    third.read_to_string(&mut why).unwrap();
    assert!(why.contains("is connected already"), "{why}");
    first.send(&frame(HEAD, 2000));
    first.close();
    wait_for(&mut said, "is gone: the pose is held");
    let mut next = Client::Tcp(connect(address));
    next.send(&frame(HEAD, 2100));
    wait_for(&mut said, "is connected by TCP");
    // In the middle of a frame.
    next.send(&frame(HEAD, 2100)[..2]);
    next.close();
    wait_for(&mut said, "is gone: the pose is held");
}

#[test]
fn other_computers_are_let_in_only_where_that_is_asked_for() {
    let follow = |arguments: &[&str]| {
        let output = bunraku()
            .arg("follow")
            .arg(workspace().join("puppets/sample.toml"))
            .args(arguments)
            .output()
            .unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, error) = follow(&["--listen", "0.0.0.0:4000"]);
    assert!(
        code == Some(1) && error.contains("--other-computers") && error.contains("127.0.0.1:4000"),
        "{error}"
    );
    let (code, error) = follow(&[]);
    assert!(code == Some(2) && error.contains("--listen"), "{error}");
    let (code, error) = follow(&["--listen", "127.0.0.1:0", "--from", "pty"]);
    assert!(code == Some(2) && error.contains("cannot be used with"), "{error}");
}

/// Virtual servos of every kind take an end as well: the puppet goes home when somebody asks for it.
#[test]
fn an_end_that_is_asked_for_brings_every_bus_home() {
    let path = workspace().join("puppets/sample-buses.toml");
    let puppet = Puppet::read(&path).unwrap();
    let map = puppet.map(puppet.channels().unwrap()).unwrap();
    let (clock, asked) = (InstantClock::default(), AtomicUsize::new(0));
    let now = || clock.now();
    let buses = virtual_buses::open(&map, &puppet_servos::read(&path).unwrap(), &now).unwrap();
    let (sender, input) = channel();
    sender.send(frame(HEAD, 2300)).unwrap();
    let mut say = |told: Told<'_>| {
        if matches!(told, Told::Line("Playing")) {
            asked.store(1, Ordering::Relaxed);
        }
    };
    let (played, _) =
        ports::follow(&input, 0, (&map, &JointNames::ids(&map)), buses, &clock, &asked, &mut say).unwrap();
    assert_eq!((played.failed, format!("{:?}", played.state)), (None, "Resting".to_owned()));
    let last: Vec<i32> =
        played.recording.goals.iter().rev().take(12).rev().map(|goal| goal.position).collect();
    assert!(last.iter().copied().eq(map.joints().iter().map(|joint| joint.home)), "{last:?}");
    assert!(played.recording.goals.iter().any(|goal| goal.id == HEAD && goal.position == 2300));
}
