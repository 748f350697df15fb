//! Uploads to a device whose flash stops it: only at rest, and never in two ticks in a row.

use crate::fuzz::{DecoderList, shelf};
use crate::virtual_device::map;
use decoder_core::mclip::CodecId;
use encoder::mclip::{Encoder, Encoding, Quality};
use firmware::device::{Device, Identity};
use firmware::fault::Feedback;
use firmware::link::frame::{Deframer, OVERHEAD, crc32, wire_len, write};
use firmware::link::message::{ANSWER_BYTES, Answer, REQUEST_BYTES, Refusal, Request, Response, VERSION};
use firmware::link::session::Session;
use firmware::link::wire::decode_all;
use firmware::machine::{Action, Command, Machine, Show, Start, State};
use firmware::map::MAX_SERVOS;
use firmware::store::Status;
use mocap::sample;
use servo_wire::bus::Reading;

#[test]
fn flash_that_stalls_is_written_at_rest_in_every_second_tick() {
    let sample = sample::clip();
    let encoder = Encoder::new(&sample.skeleton, &sample.motion).unwrap();
    let clip = encoder.encode(&Encoding::new(CodecId::Dpcm), Quality::Bits(4)).unwrap();
    let map = map("sample.toml", &sample.skeleton);
    let identity =
        Identity { name: "stalls".try_into().unwrap(), clock_hz: 1, data_bytes: 512, flash_stalls: true };
    let (mut device, mut session) = (Device::new(identity), Session::new());
    let mut machine = Machine::<_, MAX_SERVOS>::new(&map, shelf(), Show::default(), Start::Power);
    let mut reply = Deframer::<{ ANSWER_BYTES + OVERHEAD }>::new();
    let (mut number, mut ticks, mut action, mut wrote) = (0, 0, None::<Action>, Vec::new());
    // A tick with a request, and what is answered.
    let mut ask = |machine: &mut Machine<'_, DecoderList, MAX_SERVOS>, request: &Request<'_>| {
        let readings: Vec<_> = machine
            .goals()
            .iter()
            .map(|goal| {
                Some(Reading {
                    position: goal.position,
                    temperature: None,
                    millivolts: None,
                    load: None,
                    hardware_error: 0,
                    torque: Some(true),
                })
            })
            .collect();
        let feedback =
            Feedback { readings: &readings, bus: Ok(()), action: action.map(|_| Ok(())), late: false };
        let status =
            |machine: &mut Machine<'_, DecoderList, MAX_SERVOS>| machine.library().store().unwrap().status();
        let before = status(machine);
        ticks += 1;
        device.tick(machine, &feedback, ticks * 20, 0);
        wrote.push((machine.at_rest(), before != status(machine)));
        let mut buffer = [0; wire_len(REQUEST_BYTES)];
        number += 1;
        let mut frame = &*write(number, request, &mut buffer).unwrap();
        device.serve(&mut session, &mut frame, machine, &feedback);
        let outgoing = session.outgoing().to_vec();
        session.sent(outgoing.len());
        action = machine.tick(&feedback).action;
        let mut outgoing = outgoing.as_slice();
        let frame = reply.feed(&mut outgoing).unwrap().unwrap();
        match decode_all(frame.message).unwrap() {
            Answer::Response(response) => response,
            event => panic!("{event:?}"),
        }
    };
    let begin = |place| Request::Begin {
        clip: place,
        name: "clip",
        bytes: clip.len() as u32,
        crc: crc32([&clip[..]]),
    };
    ask(&mut machine, &Request::Hello { version: VERSION, session: 1 });
    // Its servos are still looked for.
    assert_eq!(ask(&mut machine, &begin(1)), Response::Refused(Refusal::Moving));
    while !machine.at_rest() {
        ask(&mut machine, &Request::Alive);
    }
    for place in [1, 2] {
        let (mut next, mut played) = (0, place == 1);
        loop {
            let end = (next + 512).min(clip.len());
            let data = Request::Data { offset: next as u32, bytes: &clip[next..end] };
            let request = match next {
                0 => begin(place),
                _ if next == clip.len() => Request::Commit,
                _ => data,
            };
            match ask(&mut machine, &request) {
                Response::Upload { next: 0 } => {
                    assert_eq!(ask(&mut machine, &data), Response::Upload { next: 512 });
                    next = 512;
                }
                Response::Upload { next: wanted } => next = wanted as usize,
                Response::Again => {}
                Response::Done => break,
                other => panic!("{other:?}"),
            }
            if next > clip.len() / 2 && !played {
                // In between somebody plays: the upload waits for rest, and goes on.
                played = true;
                let play = Command::Play { clip: 1, repeats: false };
                assert_eq!(ask(&mut machine, &Request::Command(play)), Response::Done);
                assert_eq!(ask(&mut machine, &Request::Commit), Response::Refused(Refusal::Moving));
                while !machine.at_rest() {
                    ask(&mut machine, &Request::Alive);
                }
            }
        }
    }
    assert_eq!(machine.state(), State::Resting);
    let store = machine.library().store().unwrap();
    assert_eq!((store.get(2), store.status()), (Some(&clip[..]), Status::Idle));
    assert!(wrote.iter().all(|(rests, wrote)| *rests || !wrote), "it wrote while it moved");
    assert!(wrote.windows(2).all(|pair| !(pair[0].1 && pair[1].1)), "it wrote in two ticks in a row");
    assert!(wrote.iter().filter(|(_, wrote)| *wrote).count() > 5);
}
