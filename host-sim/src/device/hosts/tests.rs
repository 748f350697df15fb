use super::*;
use firmware::link::frame::{Deframer, OVERHEAD, wire_len, write};
use firmware::link::key::{HmacKey, proof};
use firmware::link::message::{ANSWER_BYTES, Answer, REQUEST_BYTES, Refusal, Request, Response, VERSION};
use firmware::link::session::IDLE_MILLIS;
use firmware::link::wire::decode_all;
use firmware::machine::Command;
use std::time::{Duration, Instant};

const STOP: Request<'static> = Request::Command(Command::Stop);
const HOME: Request<'static> = Request::Command(Command::Home);

/// Hosts on real connections, in simulated time: what is on its way is waited for, and no time passes meanwhile.
struct Bench {
    hosts: Hosts,
    address: String,
    now: u32,
    commands: Vec<Command>,
}

/// A host.
struct Caller {
    stream: TcpStream,
    number: u16,
}

impl Bench {
    fn new(key: Option<Key>) -> Self {
        let listener = Listener::tcp("127.0.0.1:0").unwrap();
        let address = listener.name().unwrap().strip_prefix("tcp:").unwrap().to_owned();
        // Just before the clock wraps.
        Self { hosts: Hosts::new(listener, key), address, now: u32::MAX - 5_000, commands: Vec::new() }
    }

    fn tick(&mut self) {
        let Self { hosts, now, commands, .. } = self;
        hosts.serve(*now, |session, bytes| {
            session.serve(bytes, *now, |request| match *request {
                Request::Command(command) => {
                    commands.push(command);
                    Response::Done
                }
                Request::Hello { .. } => Response::Done,
                _ => Response::Again,
            });
            let _ = session.lost(*now);
        });
    }

    /// Lets time pass.
    fn wait(&mut self, millis: u32) {
        for _ in 0..millis / 20 {
            self.now = self.now.wrapping_add(20);
            self.tick();
        }
    }

    fn connect(&mut self) -> Caller {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
        self.tick();
        Caller { stream, number: 0 }
    }

    /// With a session of its own.
    fn caller(&mut self) -> Caller {
        let mut caller = self.connect();
        assert_eq!(
            self.ask(&mut caller, &Request::Hello { version: VERSION, session: 1 }),
            Some(Response::Done)
        );
        caller
    }

    /// What a request is answered; `None` where the connection is closed.
    fn ask(&mut self, caller: &mut Caller, request: &Request<'_>) -> Option<Response> {
        caller.number += 1;
        let mut buffer = [0; wire_len(REQUEST_BYTES)];
        let frame = write(caller.number, request, &mut buffer).unwrap();
        // Where the other end is closed, that is what is read.
        let _ = caller.stream.write_all(frame);
        self.answer(caller)
    }

    fn answer(&mut self, caller: &mut Caller) -> Option<Response> {
        let (mut reply, start) = (Deframer::<{ ANSWER_BYTES + OVERHEAD }>::new(), Instant::now());
        loop {
            assert!(start.elapsed() < Duration::from_secs(60), "nothing is said");
            self.tick();
            let mut buffer = [0; 500];
            let count = match caller.stream.read(&mut buffer) {
                Ok(0) => return None,
                Ok(count) => count,
                Err(error) if matches!(error.kind(), ErrorKind::ConnectionReset | ErrorKind::BrokenPipe) => {
                    return None;
                }
                Err(_) => continue,
            };
            let mut bytes = &buffer[..count];
            while let Some(frame) = reply.feed(&mut bytes) {
                let frame = frame.unwrap();
                if let (true, Some(Answer::Response(response))) =
                    (frame.sequence == caller.number, decode_all(frame.message))
                {
                    return Some(response);
                }
            }
        }
    }
}

const FULL: Option<Response> = Some(Response::Refused(Refusal::Full { hosts: HOSTS }));
const DONE: Option<Response> = Some(Response::Done);

#[test]
fn silent_connections_lock_nobody_out() {
    let mut bench = Bench::new(None);
    let _silent: Vec<Caller> = (0..HOSTS).map(|_| bench.connect()).collect();
    let mut host = bench.caller();
    assert_eq!(bench.ask(&mut host, &HOME), FULL);
    assert_eq!(bench.ask(&mut host, &STOP), DONE);
    assert_eq!(bench.commands, [Command::Stop]);
    // Those that say nothing at all go first, and whoever waits gets a place.
    bench.wait(HELLO_MILLIS + 20);
    assert_eq!(bench.ask(&mut host, &HOME), DONE);
}

#[test]
fn sessions_that_say_and_hear_nothing_end() {
    let mut bench = Bench::new(None);
    let mut hosts: Vec<Caller> = (0..HOSTS).map(|_| bench.caller()).collect();
    let held = Request::Hold { millis: 20_000 };
    assert_eq!(bench.ask(&mut hosts[0], &held), DONE);
    bench.wait(IDLE_MILLIS - 1000);
    assert_eq!(bench.ask(&mut hosts[1], &Request::Alive), DONE);
    bench.wait(2000);
    assert_eq!(bench.ask(&mut hosts[0], &Request::Alive), DONE, "it said that it may be silent for 20 s");
    assert_eq!(bench.ask(&mut hosts[1], &Request::Alive), DONE, "it was heard in time");
    assert_eq!(bench.ask(&mut hosts[2], &Request::Alive), None);
    assert_eq!(bench.ask(&mut hosts[3], &Request::Alive), None);
    for _ in 0..2 {
        let mut new = bench.caller();
        assert_eq!(bench.ask(&mut new, &HOME), DONE);
        hosts.push(new);
    }
    let mut guest = bench.caller();
    assert_eq!(bench.ask(&mut guest, &HOME), FULL);
}

/// Hosts that talk keep their places; any number of others can stop the puppet, for a while each.
#[test]
fn a_stop_gets_through_where_all_places_are_taken() {
    let mut bench = Bench::new(None);
    let mut hosts: Vec<Caller> = (0..HOSTS).map(|_| bench.caller()).collect();
    let mut guests: Vec<Caller> = (0..3 * GUESTS).map(|_| bench.connect()).collect();
    let mut guest = bench.caller();
    assert_eq!(bench.ask(&mut guest, &STOP), DONE);
    assert_eq!(bench.ask(&mut guest, &Request::Alive), DONE);
    for refused in [HOME, Request::Telemetry { millis: 20 }, Request::Hold { millis: 20 }, Request::Commit] {
        assert_eq!(bench.ask(&mut guest, &refused), FULL, "{refused:?}");
    }
    assert_eq!(bench.hosts.hosts.len(), usize::from(HOSTS) + GUESTS, "no more than that are kept");
    for host in &mut hosts {
        assert_eq!(bench.ask(host, &Request::Alive), DONE);
    }
    bench.wait(HELLO_MILLIS + 20);
    assert_eq!(bench.ask(&mut guest, &STOP), None, "its time is over");
    assert_eq!(bench.hosts.hosts.len(), usize::from(HOSTS));
    guests.clear();
    // A place that becomes free is the next one's.
    let mut next = bench.caller();
    assert_eq!(bench.ask(&mut next, &HOME), FULL);
    drop(hosts.pop());
    let start = Instant::now();
    while bench.ask(&mut next, &HOME) == FULL {
        assert!(start.elapsed() < Duration::from_secs(60), "the place is never free");
    }
}

/// Eight megabytes of noise, with and without zeros, in front of a request: it is answered within a second of ticks.
#[test]
fn noise_does_not_deafen_a_line() {
    for zeros in [0, 1] {
        let mut bench = Bench::new(None);
        let mut host = bench.caller();
        let mut stream = host.stream.try_clone().unwrap();
        let mut random = fastrand::Rng::with_seed(3);
        let noise: Vec<u8> = (0..8 << 20).map(|_| random.u8(1 - zeros..)).collect();
        host.number += 1;
        let mut buffer = [0; 100];
        let frame = write(host.number, &HOME, &mut buffer).unwrap().to_vec();
        let writer = std::thread::spawn(move || {
            stream.write_all(&noise).unwrap();
            stream.write_all(&[0]).unwrap();
            stream.write_all(&frame).unwrap();
        });
        let mut ticks = 0;
        while !bench.commands.contains(&Command::Home) {
            let read = bench.hosts.hosts[0].serves;
            bench.tick();
            // A tick that found nothing waited for the writer.
            ticks += u32::from(bench.hosts.hosts[0].serves - read > 2);
            if bench.hosts.hosts[0].serves - read <= 2 {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        writer.join().unwrap();
        assert!(ticks < 50, "{ticks} ticks");
        assert_eq!(bench.answer(&mut host), DONE);
    }
}

#[test]
fn a_key_is_asked_for_on_each_connection() {
    let lock: &'static HmacKey = Box::leak(Box::new(HmacKey::new(b"0123456789abcdef").unwrap()));
    let mut bench = Bench::new(Some(Key { lock, seed: 5 }));
    let hello = Request::Hello { version: VERSION, session: 9 };
    let mut nonces = Vec::new();
    for right in [true, false] {
        let mut host = bench.connect();
        let Some(Response::Challenge { nonce }) = bench.ask(&mut host, &hello) else {
            panic!("no challenge")
        };
        assert_eq!(bench.ask(&mut host, &STOP), Some(Response::Refused(Refusal::NoSession)));
        let mut proof = proof(lock, &nonce, 9);
        proof[0] ^= u8::from(!right);
        nonces.push(nonce);
        let answer = bench.ask(&mut host, &Request::Prove { proof: &proof });
        let refused = Some(Response::Refused(Refusal::Key));
        assert_eq!(answer, if right { DONE } else { refused });
        let expected = if right { DONE } else { Some(Response::Refused(Refusal::NoSession)) };
        assert_eq!(bench.ask(&mut host, &STOP), expected);
    }
    assert_ne!(nonces[0], nonces[1]);
}

/// The page's second table of figures.
#[test]
fn the_page_has_these_figures() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/LINK.md")).unwrap();
    for (name, value) in [
        ("hosts", usize::from(HOSTS)),
        ("connections that wait", GUESTS),
        ("ms in which a connection says hello", HELLO_MILLIS as usize),
    ] {
        assert!(
            page.contains(&format!("\n| {name} | {value} |\n")),
            "docs/LINK.md has another figure of {name}: {value}"
        );
    }
    let prose = [
        format!("places for {HOSTS} hosts"),
        format!("{GUESTS} connections"),
        format!("for {} s", HELLO_MILLIS / 1000),
    ];
    for words in prose {
        assert!(page.contains(&words), "docs/LINK.md does not say {words:?}");
    }
}
