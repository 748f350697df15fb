//! What answers wrongly, or not at all: one sentence, in a bounded time.

use bunraku_tests::bunraku;
use firmware::link::frame::{wire_len, write};
use firmware::link::wire::Raw;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::process::Output;
use std::time::{Duration, Instant};

/// Something at a port that says this to whatever it hears.
fn answering(answer: Vec<u8>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for host in listener.incoming() {
            let (mut host, answer) = (host.unwrap(), answer.clone());
            std::thread::spawn(move || {
                let mut buffer = [0; 1000];
                while let Ok(1..) = host.read(&mut buffer) {
                    if host.write_all(&answer).is_err() {
                        break;
                    }
                }
            });
        }
    });
    port
}

fn fails(port: &str, arguments: &[&str], expected: &str) {
    let start = Instant::now();
    let Output { status, stdout, stderr } = bunraku().args(arguments).output().unwrap();
    let said = String::from_utf8(stderr).unwrap();
    assert_eq!(status.code(), Some(1), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(stdout.is_empty());
    assert!(said.contains(expected) && said.contains(port), "{expected:?} is not in {said:?}");
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

#[test]
fn what_is_no_device_is_told_in_a_sentence() {
    let mut buffer = [0; wire_len(40)];
    // A response to a hello (0, 0) of version 9 of which only the beginning is known.
    let other = write(1, &Raw(&[0, 0, 9, 77, 1, 1, 1, 1, 1, 1, 1, 1, 1]), &mut buffer).unwrap().to_vec();
    let port = answering(other);
    fails(&port, &["push", &port, "status"], "speaks version 9 of the link, this program version 1");
    let port = answering(b"HTTP/1.1 400 Bad Request\r\n\r\n\0".to_vec());
    fails(&port, &["push", &port, "list"], "does not answer: asked 10 times in 3");
    let port = answering(Vec::new());
    fails(&port, &["monitor", &port], "does not answer");
    // Nobody listens there any more.
    let port = format!("tcp:{}", TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap());
    fails(&port, &["push", &port, "stop"], "cannot open");
    fails("/no/such/port", &["push", "/no/such/port", "stop"], "cannot open");
}
