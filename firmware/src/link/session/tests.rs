use super::*;
use crate::clips::LIVE;
use crate::link::cobs_writer::CobsWriter;
use crate::link::frame::FrameError;
use crate::link::message::{DATA_BYTES, Hello, Playing, ServoInfo, Streaming};
use crate::link::wire::{Encode, decode_all};
use crate::machine::Command;
use crate::map::MAX_SERVOS;
use crate::play_error::PlayError;
use crate::stream::{Counters, Progress};
use decoder_core::{Error, Field};
use proptest::prelude::*;
use servo_wire::bus::Reading;
use std::collections::VecDeque;
use std::vec::Vec as List;

/// A request, and what a later version has behind it.
struct Longer<'a>(Request<'a>, &'a [u8]);

impl Encode for Longer<'_> {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        self.0.encode(out);
        self.1.iter().for_each(|&byte| out.put(byte));
    }
}

fn hello(session: u32) -> Request<'static> {
    Request::Hello { version: VERSION, session }
}

fn frame(number: u16, request: &Request<'_>) -> List<u8> {
    let mut buffer = [0; wire_len(REQUEST_BYTES)];
    write(number, request, &mut buffer).unwrap().to_vec()
}

fn me() -> Response {
    Response::Hello(Hello {
        version: VERSION,
        firmware: "0.1.0".try_into().unwrap(),
        name: "a device".try_into().unwrap(),
        servos: 3,
        tick_hz: 100,
        clock_hz: 64_000_000,
        data_bytes: 512,
        clip_bytes: 1 << 18,
        flash_stalls: false,
    })
}

/// What a device says that plays nothing and has no room.
fn telemetry(millis: u32, state: State) -> Telemetry {
    Telemetry {
        millis,
        state,
        fault: None,
        playing: None,
        speed: 256,
        ticks: 1,
        missed: 0,
        busy: 0,
        busiest: 0,
        bus: None,
        stream: None,
        link: LinkCounts::default(),
        servos: Vec::new(),
    }
}

/// All that a session has to say.
fn said(session: &mut Session) -> List<(u16, Answer)> {
    let mut deframer = Deframer::<{ ANSWER_BYTES + OVERHEAD }>::new();
    let bytes = session.outgoing().to_vec();
    session.sent(bytes.len());
    assert!(session.outgoing().is_empty());
    let (mut rest, mut answers) = (bytes.as_slice(), List::new());
    while let Some(frame) = deframer.feed(&mut rest) {
        let frame = frame.unwrap();
        answers.push((frame.sequence, decode_all(frame.message).unwrap()));
    }
    answers
}

/// Gives a session bytes, and what it says and what it passed on.
fn serve(session: &mut Session, bytes: &[u8], now: u32) -> (List<(u16, Answer)>, List<Command>) {
    let (mut rest, mut answers, mut done) = (bytes, List::new(), List::new());
    loop {
        let before = rest.len();
        session.serve(&mut rest, now, |request| match request {
            Request::Hello { .. } => me(),
            Request::Command(command) => {
                done.push(*command);
                Response::Done
            }
            _ => Response::Refused(Refusal::NoStore),
        });
        answers.extend(said(session));
        if rest.len() == before {
            assert!(rest.is_empty(), "bytes are taken while there are any");
            return (answers, done);
        }
    }
}

fn done(number: u16) -> (u16, Answer) {
    (number, Answer::Response(Response::Done))
}

const STOP: Request<'static> = Request::Command(Command::Stop);

#[test]
fn nothing_is_done_before_a_hello_of_this_version() {
    let mut session = Session::new();
    let (answers, commands) = serve(&mut session, &frame(1, &STOP), 0);
    assert_eq!((answers, commands), (vec![(1, refused(Refusal::NoSession))], vec![]));
    let other = Request::Hello { version: VERSION + 1, session: 9 };
    // A later version's hello may be longer.
    for bytes in [frame(2, &other), frame(2, &Request::Data { offset: 7, bytes: &[] })] {
        serve(&mut session, &bytes, 0);
        assert!(!session.is_open());
    }
    let mut buffer = [0; 40];
    let longer = write(3, &Longer(other, &[5, 6]), &mut buffer).unwrap().to_vec();
    assert_eq!(serve(&mut session, &longer, 0).0, [(3, Answer::Response(me()))]);
    assert_eq!(serve(&mut session, &frame(4, &STOP), 0).0, [(4, refused(Refusal::NoSession))]);
    assert_eq!(serve(&mut session, &frame(5, &hello(9)), 0).0, [(5, Answer::Response(me()))]);
    assert_eq!(serve(&mut session, &frame(6, &STOP), 0), (vec![done(6)], vec![Command::Stop]));
    // Of this version nothing follows.
    let longer = write(7, &Longer(hello(8), &[5]), &mut buffer).unwrap().to_vec();
    assert_eq!(serve(&mut session, &longer, 0).0, [(7, refused(Refusal::Unknown))]);
}

#[test]
fn a_doubled_request_is_answered_again_and_done_once() {
    let mut session = Session::new();
    serve(&mut session, &frame(0xfffe, &hello(1)), 0);
    let (stop, home) = (frame(0xffff, &STOP), frame(0, &Request::Command(Command::Home)));
    let bytes = [&stop[..], &stop, &home, &home, &stop, &home].concat();
    let (answers, commands) = serve(&mut session, &bytes, 0);
    assert_eq!(commands, [Command::Stop, Command::Home]);
    assert_eq!(answers, [0xffff, 0xffff, 0, 0, 0].map(done));
    assert_eq!(session.counts.repeated, 4);
    // A hello of the same session does not begin it again; that of another does.
    assert!(serve(&mut session, &[frame(0xfffe, &hello(1)), stop.clone()].concat(), 0).1.is_empty());
    assert_eq!(serve(&mut session, &[frame(0xfffe, &hello(2)), stop].concat(), 0).1, [Command::Stop]);
}

#[test]
fn what_is_no_request_is_refused() {
    let mut session = Session::new();
    serve(&mut session, &frame(0, &hello(1)), 0);
    let mut buffer = [0; 40];
    // A variant that there is none of; a slice that is longer than its frame; one byte too many.
    for message in [&[99u8][..], &[7, 0, 200, 1, 7], &[1, 0]] {
        let mut raw = vec![5];
        raw.extend(message);
        raw.extend(super::super::frame::crc32([&raw[..]]).to_le_bytes());
        let len = cobs::encode(&raw, &mut buffer);
        let (answers, commands) = serve(&mut session, &buffer[..=len], 0);
        assert_eq!((answers, commands), (vec![(5, refused(Refusal::Unknown))], vec![]));
        buffer.fill(0);
    }
    assert_eq!(session.counts.unknown, 3);
    // The longest request fits.
    let longest = frame(6, &Request::Data { offset: u32::MAX, bytes: &[0xff; DATA_BYTES] });
    assert_eq!(serve(&mut session, &longest, 0).0, [(6, refused(Refusal::NoStore))]);
}

#[test]
fn silence_is_a_loss_only_on_a_link_that_is_held() {
    let mut session = Session::new();
    serve(&mut session, &frame(0, &hello(1)), u32::MAX - 50);
    assert!(!session.lost(10_000));
    serve(&mut session, &frame(1, &Request::Hold { millis: 100 }), u32::MAX - 20);
    assert!(!session.lost(79), "over the end of the clock");
    serve(&mut session, &frame(2, &Request::Alive), 79);
    // Noise is no sign of life.
    serve(&mut session, &[1, 2, 3, 0], 170);
    assert!(!session.lost(179));
    assert!(session.lost(180));
    assert!(!session.lost(181), "once");
    serve(&mut session, &frame(3, &Request::Hold { millis: 100 }), 200);
    serve(&mut session, &frame(4, &Request::Hold { millis: 0 }), 250);
    assert!(!session.lost(10_000));
    // That another host comes does not bring back the one who has to be there.
    serve(&mut session, &frame(5, &Request::Hold { millis: 100 }), 10_000);
    serve(&mut session, &frame(0, &hello(2)), 10_050);
    assert!(session.is_held() && !session.lost(10_150));
    assert!(session.lost(10_151) && !session.is_held());
}

#[test]
fn telemetry_comes_at_its_rate_and_at_every_change() {
    let mut session = Session::new();
    serve(&mut session, &frame(0, &hello(1)), 0);
    let mut told = List::new();
    let mut tick = |session: &mut Session, now: u32| {
        let state = if now < 300 { State::Holding } else { State::Playing };
        if session.telemetry_due(now, state, None) {
            session.tell(telemetry(now, state));
            assert_eq!(said(session).len(), 1);
            told.push(now);
        }
    };
    (0..10).for_each(|now| tick(&mut session, now * 10));
    serve(&mut session, &frame(1, &Request::Telemetry { millis: 100 }), 100);
    (10..50).for_each(|now| tick(&mut session, now * 10));
    serve(&mut session, &frame(2, &Request::Telemetry { millis: 0 }), 500);
    (50..90).for_each(|now| tick(&mut session, now * 10));
    assert_eq!(told, [100, 200, 300, 400]);
}

#[test]
fn one_who_does_not_read_is_obeyed_and_not_waited_for() {
    let mut session = Session::new();
    serve(&mut session, &frame(0, &hello(1)), 0);
    let mut done = 0;
    for number in 1..1000 {
        let bytes = frame(number, &STOP);
        let mut rest = bytes.as_slice();
        session.serve(&mut rest, 0, |_| {
            done += 1;
            Response::Done
        });
        assert!(rest.is_empty());
        session.tell(telemetry(0, State::Holding));
        assert!(session.outgoing().len() <= OUT_BYTES);
    }
    assert_eq!(done, 999);
    assert!(session.counts.dropped > 900);
    // What it has to say is whole frames, however they are sent.
    let mut deframer = Deframer::<{ ANSWER_BYTES + OVERHEAD }>::new();
    while !session.outgoing().is_empty() {
        let bytes: List<u8> = session.outgoing().iter().take(7).copied().collect();
        session.sent(7);
        let mut rest = bytes.as_slice();
        while let Some(frame) = deframer.feed(&mut rest) {
            decode_all::<Answer>(frame.unwrap().message).unwrap();
        }
    }
}

#[test]
fn the_largest_answers_fit() {
    let error = Error::Checksum { field: Field::Halves, at: usize::MAX, found: u32::MAX, expected: u32::MAX };
    let fault = Fault::Clip { error };
    let reading = Reading {
        position: i32::MIN,
        temperature: Some(u8::MAX),
        millivolts: Some(u16::MAX),
        load: Some(i16::MIN),
        hardware_error: u8::MAX,
        torque: Some(true),
    };
    let servo = ServoInfo { id: 252, goal: -crate::map::GOAL_LIMIT, reading: Some(reading) };
    let m = u32::MAX;
    let progress = Progress { position: m, received: m, frames: m, free_blocks: u16::MAX, blocks: u16::MAX };
    let counters = Counters {
        played: m,
        concealed: m,
        eased: m,
        lost: m,
        late: m,
        duplicates: m,
        damaged: m,
        overflowed: m,
    };
    let stream = Streaming { progress, counters };
    let most = Telemetry {
        millis: u32::MAX,
        fault: Some(fault),
        playing: Some(Playing { clip: LIVE, frame: u32::MAX, phase: u16::MAX }),
        speed: u16::MAX,
        ticks: u32::MAX,
        missed: u32::MAX,
        busy: u32::MAX,
        busiest: u32::MAX,
        bus: Some(servo_wire::bus::BusError::Refused(255)),
        stream: Some(stream),
        link: LinkCounts { damaged: u32::MAX, repeated: u32::MAX, unknown: u32::MAX, dropped: u32::MAX },
        servos: core::iter::repeat_n(servo, MAX_SERVOS).collect(),
        ..telemetry(0, State::Limp)
    };
    // What docs/LINK.md says of a device's memory.
    assert!(size_of::<Session>() <= 3400, "{} bytes", size_of::<Session>());
    let len = |answer: Answer| {
        let mut buffer = [0; 4000];
        let mut written: &[u8] = write(0, &answer, &mut buffer).unwrap();
        Deframer::<4000>::new().feed(&mut written).unwrap().unwrap().message.len()
    };
    assert!(len(Answer::Event(Event::Telemetry(most))) <= ANSWER_BYTES);
    let mut hello = Hello {
        version: 255,
        firmware: heapless::String::new(),
        name: heapless::String::new(),
        servos: 255,
        tick_hz: u16::MAX,
        clock_hz: u32::MAX,
        data_bytes: u16::MAX,
        clip_bytes: u32::MAX,
        flash_stalls: true,
    };
    while hello.firmware.push('x').is_ok() {}
    while hello.name.push('x').is_ok() {}
    let responses = [
        Response::Hello(hello),
        Response::Stream(stream),
        Response::Refused(Refusal::Fault(fault)),
        Response::Refused(Refusal::Play(PlayError::Clip(error))),
    ];
    for response in responses {
        assert!(len(Answer::Response(response)) <= RESPONSE_BYTES);
    }
}

/// A line that loses, damages, doubles, delays and cuts what it carries.
struct Line {
    faults: VecDeque<u8>,
    late: List<List<u8>>,
}

impl Line {
    fn carry(&mut self, bytes: &[u8]) -> List<u8> {
        let mut bytes = bytes.to_vec();
        let fault = self.faults.pop_front().unwrap_or(u8::MAX);
        let at = usize::from(fault / 8) % bytes.len().max(1);
        match fault % 16 {
            _ if bytes.is_empty() => {}
            0 | 8 => bytes.clear(),
            1 => bytes[at] ^= 1 << (fault / 32),
            2 => bytes.truncate(at),
            3 => bytes.extend(bytes.clone()),
            4 => self.late.push(core::mem::take(&mut bytes)),
            5 => drop(bytes.drain(..at)),
            6 => {
                // What was late comes before it.
                let late = self.late.pop().unwrap_or_default();
                bytes.splice(0..0, late);
            }
            7 => bytes.extend(self.late.drain(..).flatten()),
            _ => {}
        }
        bytes
    }
}

proptest! {
    #[test]
    fn any_bytes_however_cut_give_bounded_answers(
        bytes in prop::collection::vec(prop_oneof![3 => any::<u8>(), 1 => Just(0)], 0..2000),
        cuts in prop::collection::vec(1usize..300, 0..20),
        opened in any::<bool>(),
    ) {
        let mut session = Session::new();
        if opened {
            serve(&mut session, &frame(0, &hello(1)), 0);
        }
        let mut rest = bytes.as_slice();
        for cut in cuts {
            let (mut chunk, after) = rest.split_at(cut.min(rest.len()));
            rest = after;
            session.serve(&mut chunk, 0, |_| Response::Done);
            prop_assert!(session.outgoing().len() <= OUT_BYTES);
        }
    }

    /// A host that asks until it is answered has each request done once and in order, whatever the line does.
    #[test]
    fn every_request_is_done_once_and_in_order(
        there in prop::collection::vec(any::<u8>(), 0..150),
        back in prop::collection::vec(any::<u8>(), 0..150),
        start in any::<u16>(),
    ) {
        let mut session = Session::new();
        let line = |faults: List<u8>| Line { faults: faults.into(), late: List::new() };
        let (mut there, mut back) = (line(there), line(back));
        let mut reply = Deframer::<{ ANSWER_BYTES + OVERHEAD }>::new();
        let mut executed = List::new();
        let frames = 20u32;
        for step in 0..=frames {
            let number = start.wrapping_add(step as u16);
            let request = if step == 0 { hello(77) } else { Request::Command(Command::Seek { frame: step }) };
            let mut answered = false;
            let mut tries = 0;
            while !answered {
                tries += 1;
                prop_assert!(tries < 400);
                let bytes = there.carry(&frame(number, &request));
                let mut rest = bytes.as_slice();
                while !rest.is_empty() {
                    session.serve(&mut rest, 0, |request| match request {
                        Request::Hello { .. } => me(),
                        Request::Command(Command::Seek { frame }) => {
                            executed.push(*frame);
                            Response::Done
                        }
                        other => panic!("{other:?} was never sent"),
                    });
                }
                let bytes = back.carry(session.outgoing());
                let len = session.outgoing().len();
                session.sent(len);
                let mut rest = bytes.as_slice();
                while let Some(frame) = reply.feed(&mut rest) {
                    match frame {
                        Ok(frame) => answered |= frame.sequence == number,
                        Err(error) => prop_assert!(matches!(error, FrameError::Cut | FrameError::Damaged | FrameError::TooShort | FrameError::TooLong)),
                    }
                }
            }
            prop_assert_eq!(executed.len() as u32, step);
        }
        prop_assert!(executed.iter().copied().eq(1..=frames));
    }
}

/// Doubled frames, old proofs and proofs of other sessions: a key lets nobody in who does not have it, and whoever has it at once.
#[test]
fn a_locked_line_hears_who_has_the_key() {
    use crate::link::key::{HmacKey, proof};
    let lock: &'static HmacKey = Box::leak(Box::new(HmacKey::new(&[7; 16]).unwrap()));
    let mut session = Session::locked(lock, 3);
    let key = |number| (number, refused(Refusal::Key));
    let none = |number| (number, refused(Refusal::NoSession));
    let challenge = |session: &mut Session, number: u16, host: u32| {
        let (answers, _) =
            serve(session, &[frame(number, &hello(host)), frame(number, &hello(host))].concat(), 0);
        let [(_, Answer::Response(Response::Challenge { nonce })), again] = &answers[..] else {
            panic!("{answers:?}")
        };
        assert_eq!(*again, answers[0], "a hello that comes twice is challenged once");
        nonce.clone()
    };
    let first = challenge(&mut session, 5, 1);
    assert_eq!(serve(&mut session, &frame(6, &STOP), 0), (vec![none(6)], vec![]));
    let old = proof(lock, &first, 1);
    let second = challenge(&mut session, 7, 2);
    assert_ne!(first, second);
    // The proof of the challenge before, and of another session.
    assert_eq!(serve(&mut session, &frame(8, &Request::Prove { proof: &old }), 0).0, [key(8)]);
    let third = challenge(&mut session, 9, 2);
    let other = proof(lock, &third, 1);
    assert_eq!(serve(&mut session, &frame(10, &Request::Prove { proof: &other }), 0).0, [key(10)]);
    // A challenge is for one proof, though it were the right one.
    let right = proof(lock, &third, 2);
    assert_eq!(serve(&mut session, &frame(11, &Request::Prove { proof: &right }), 0).0, [key(11)]);
    assert!(!session.is_open());
    let fourth = challenge(&mut session, 12, 2);
    let right = proof(lock, &fourth, 2);
    let prove = frame(13, &Request::Prove { proof: &right });
    let twice = [(13, Answer::Response(me())), (13, Answer::Response(me()))];
    assert_eq!(serve(&mut session, &[&prove[..], &prove].concat(), 0).0, twice);
    assert_eq!(serve(&mut session, &frame(14, &STOP), 0), (vec![done(14)], vec![Command::Stop]));
    assert_eq!(session.number(), Some(2));
    // Who comes after a hang up has to prove it again, and a hold outlives that.
    serve(&mut session, &frame(15, &Request::Hold { millis: 100 }), 0);
    session.hang_up();
    assert_eq!(serve(&mut session, &frame(16, &STOP), 0).0, [none(16)]);
    assert!(session.is_held() && session.lost(200));
    // An open line has no use for proofs.
    let mut open = Session::new();
    assert_eq!(serve(&mut open, &frame(1, &Request::Prove { proof: &right }), 0).0, [key(1)]);
}

#[test]
fn who_has_no_place_is_heard_when_it_says_stop() {
    let mut session = Session::new();
    session.seat(Some(4));
    assert_eq!(serve(&mut session, &frame(1, &hello(1)), 0).0, [(1, Answer::Response(me()))]);
    let full = |number| (number, refused(Refusal::Full { hosts: 4 }));
    for (number, request) in [
        (2, Request::Command(Command::Home)),
        (3, Request::Hold { millis: 9 }),
        (4, Request::Telemetry { millis: 9 }),
        (5, Request::Clip { index: 0 }),
    ] {
        assert_eq!(serve(&mut session, &frame(number, &request), 0), (vec![full(number)], vec![]));
    }
    assert!(!session.is_held());
    assert_eq!(serve(&mut session, &frame(6, &Request::Alive), 0).0, [done(6)]);
    assert_eq!(serve(&mut session, &frame(7, &STOP), 0).1, [Command::Stop]);
    session.seat(None);
    assert_eq!(serve(&mut session, &frame(8, &Request::Command(Command::Home)), 0).1, [Command::Home]);
}
