//! Whose an upload is, which clips are taken, and what a stream's progress counts: a device in simulated time, with two hosts.

use crate::fuzz::{DecoderList, shelf};
use crate::virtual_device::map;
use decoder_core::Limits;
use decoder_core::mclip::{Clip as Mclip, CodecId, Prefix};
use encoder::mclip::{Encoder, Encoding, Quality};
use encoder::qmd::{Method, Parameters};
use firmware::clips::LIVE;
use firmware::demands::Facts;
use firmware::device::{Device, Identity, UPLOAD_MILLIS};
use firmware::fault::Feedback;
use firmware::link::frame::{Deframer, OVERHEAD, crc32, wire_len, write};
use firmware::link::message::{ANSWER_BYTES, Answer, REQUEST_BYTES, Refusal, Request, Response, VERSION};
use firmware::link::session::Session;
use firmware::link::wire::decode_all;
use firmware::machine::{Action, Command, Machine, Show, Start, State};
use firmware::map::MAX_SERVOS;
use firmware::play_error::PlayError;
use firmware::store::StoreError;
use firmware::stream::Progress;
use mocap::{Clip, sample};
use puppet_file::Map;
use servo_wire::bus::Reading;

const BUSY: Response = Response::Refused(Refusal::Store(StoreError::Busy));

/// A device and its hosts. A request takes a tick of 20 ms.
struct World<'m> {
    device: Device,
    machine: Machine<'m, DecoderList, MAX_SERVOS>,
    sessions: Vec<Session>,
    number: u16,
    ticks: u32,
    action: Option<Action>,
}

impl<'m> World<'m> {
    fn new(map: &'m Map, hosts: usize) -> Self {
        let identity =
            Identity { name: "world".try_into().unwrap(), clock_hz: 1, data_bytes: 512, flash_stalls: false };
        let mut world = Self {
            device: Device::new(identity),
            machine: Machine::new(map, shelf(), Show::default(), Start::Power),
            sessions: (0..hosts).map(|_| Session::new()).collect(),
            number: 0,
            ticks: 0,
            action: None,
        };
        for host in 0..hosts {
            // All draw the same number: a device does not tell them apart by that.
            world.hello(host, 1);
        }
        while !world.machine.at_rest() {
            world.tick(None);
        }
        world
    }

    fn hello(&mut self, host: usize, session: u32) {
        let hello = self.ask(host, &Request::Hello { version: VERSION, session });
        assert!(matches!(hello, Response::Hello(_)), "{hello:?}");
    }

    /// A tick, with a request of a host or without one.
    fn tick(&mut self, asked: Option<(usize, &Request<'_>)>) -> Option<Response> {
        let held = |position| Reading {
            position,
            temperature: None,
            millivolts: None,
            load: None,
            hardware_error: 0,
            torque: Some(true),
        };
        let readings: Vec<_> = self.machine.goals().iter().map(|goal| Some(held(goal.position))).collect();
        let action = self.action.map(|_| Ok(()));
        let feedback = Feedback { readings: &readings, bus: Ok(()), action, late: false };
        self.ticks += 1;
        self.device.tick(&mut self.machine, &feedback, self.ticks * 20, 0);
        let response = asked.map(|(host, request)| {
            self.number = self.number.wrapping_add(1);
            let mut buffer = [0; wire_len(REQUEST_BYTES)];
            let mut frame = &*write(self.number, request, &mut buffer).unwrap();
            let session = &mut self.sessions[host];
            self.device.serve(session, &mut frame, &mut self.machine, &feedback);
            let outgoing = session.outgoing().to_vec();
            session.sent(outgoing.len());
            let mut reply = Deframer::<{ ANSWER_BYTES + OVERHEAD }>::new();
            match decode_all(reply.feed(&mut outgoing.as_slice()).unwrap().unwrap().message).unwrap() {
                Answer::Response(response) => response,
                event => panic!("{event:?}"),
            }
        });
        self.action = self.machine.tick(&feedback).action;
        response
    }

    fn ask(&mut self, host: usize, request: &Request<'_>) -> Response {
        self.tick(Some((host, request))).unwrap()
    }

    /// Asks again while it is told to.
    fn ready(&mut self, host: usize, request: &Request<'_>) -> Response {
        loop {
            match self.ask(host, request) {
                Response::Again => {}
                response => return response,
            }
        }
    }

    fn wait(&mut self, millis: u32) {
        (0..millis / 20).for_each(|_| assert!(self.tick(None).is_none()));
    }

    /// What the end of an upload is answered.
    fn upload(&mut self, host: usize, clip: u16, bytes: &[u8]) -> Response {
        let mut response = self.ready(host, &begin(clip, bytes));
        while let Response::Upload { next } = response {
            let next = next as usize;
            if next == bytes.len() {
                return self.ready(host, &Request::Commit);
            }
            let end = (next + 512).min(bytes.len());
            response = self.ready(host, &Request::Data { offset: next as u32, bytes: &bytes[next..end] });
        }
        response
    }

    fn stored(&mut self) -> Vec<u16> {
        self.machine.library().store().unwrap().list().map(|entry| entry.clip).collect()
    }
}

fn begin(clip: u16, bytes: &[u8]) -> Request<'static> {
    Request::Begin { clip, name: "clip", bytes: bytes.len() as u32, crc: crc32([bytes]) }
}

pub fn encode(clip: &Clip) -> Vec<u8> {
    let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
    encoder.encode(&Encoding::new(CodecId::Dpcm), Quality::Bits(4)).unwrap()
}

/// The sample with another name of its first joint's channels.
pub fn renamed() -> Clip {
    let mut clip = sample::clip();
    let old = clip.skeleton.joints[0].name.clone();
    clip.skeleton.joints[0].name = "pelvis".to_owned();
    for channel in &mut clip.skeleton.channels {
        if let Some(kind) = channel.name.strip_prefix(&format!("{old}.")) {
            channel.name = format!("pelvis.{kind}");
        }
    }
    clip
}

#[test]
fn an_upload_is_its_sessions_until_that_is_silent() {
    let sample = sample::clip();
    let (map, clip) = (map("sample.toml", &sample.skeleton), encode(&sample));
    let mut world = World::new(&map, 2);
    assert_eq!(world.ready(0, &begin(1, &clip)), Response::Upload { next: 0 });
    let data = Request::Data { offset: 0, bytes: &clip[..512] };
    assert_eq!(world.ready(0, &data), Response::Upload { next: 512 });
    // At once, and without harm.
    for other in [
        begin(2, &clip),
        begin(1, &clip),
        data,
        Request::Commit,
        Request::Abandon,
        Request::Remove { clip: 1 },
    ] {
        assert_eq!(world.ask(1, &other), BUSY, "{other:?}");
    }
    assert_eq!(world.ready(0, &data), Response::Upload { next: 512 }, "it is where it was");
    // As long as it goes on, and not longer.
    world.wait(UPLOAD_MILLIS - 40);
    assert_eq!(world.ask(1, &begin(2, &clip)), BUSY);
    assert_eq!(world.ready(0, &data), Response::Upload { next: 512 });
    world.wait(UPLOAD_MILLIS + 20);
    assert_eq!(world.ask(1, &data), Response::Refused(Refusal::Store(StoreError::NoUpload)));
    assert_eq!(
        world.ask(1, &begin(1, &clip)),
        Response::Upload { next: 512 },
        "who begins the same goes on with it"
    );
    assert_eq!(world.ask(0, &data), BUSY, "it is the other's now");
    assert_eq!(world.upload(1, 1, &clip), Response::Done);
    assert_eq!(world.stored(), [1]);
    // Nobody's: each may begin at once. A new session of the same line is another one.
    assert_eq!(world.ready(0, &begin(2, &clip)), Response::Upload { next: 0 });
    world.hello(0, 2);
    assert_eq!(world.ask(0, &data), BUSY);
    world.wait(UPLOAD_MILLIS + 20);
    assert_eq!(world.upload(0, 2, &clip), Response::Done);
    assert_eq!(world.stored(), [1, 2]);
    assert_eq!(world.ready(1, &Request::Remove { clip: 1 }), Response::Done);
}

#[test]
fn clips_that_the_puppet_cannot_play_are_refused_at_upload() {
    let sample = sample::clip();
    let map = map("sample.toml", &sample.skeleton);
    let right = encode(&sample);
    let mut world = World::new(&map, 1);
    assert_eq!(world.upload(0, 1, &right), Response::Done);
    let other = encode(&renamed());
    let found = Facts::of(&other).unwrap().names.unwrap();
    let names = PlayError::Names { found, expected: map.names() };
    let kept: Vec<_> = ["head.ry"].map(|name| sample.skeleton.channel(name).unwrap()).to_vec();
    let few =
        Clip { skeleton: sample.skeleton.with_channels(&kept), motion: sample.motion.with_channels(&kept) };
    let channels = PlayError::Channels { found: 1, expected: 31 };
    for (bytes, error) in [(&other, names), (&encode(&few), channels)] {
        assert_eq!(world.upload(0, 1, bytes), Response::Refused(Refusal::Store(StoreError::Play(error))));
        assert_eq!(world.machine.library().store().unwrap().get(1), Some(&right[..]), "the old one stays");
    }
    assert!(names.to_string().contains("bunraku encode --puppet"), "{names}");
    // One without names, of which only the number is known.
    let qmd = encoder::qmd::encode(&sample, Parameters::TABLE_1, Method::ClosedLoop).unwrap();
    assert_eq!(Facts::of(&qmd).unwrap().names, None);
    assert_eq!(world.upload(0, 2, &qmd), Response::Done);
}

/// A map of another skeleton is one that came after the clips: then it is at play that they are refused.
#[test]
fn clips_of_an_earlier_map_are_refused_at_play() {
    let sample = sample::clip();
    let (before, clip) = (map("sample.toml", &sample.skeleton), encode(&sample));
    let other = before.clone().with_names(7);
    let mut world = World::new(&other, 1);
    let store = world.machine.library().store().unwrap();
    // Written past the device, as by its earlier firmware.
    store.begin(1, "clip", clip.len() as u32, crc32([&clip[..]])).unwrap();
    while !matches!(store.step().unwrap(), firmware::store::Status::Receiving { .. }) {}
    store.write(0, &clip).unwrap();
    store.commit().unwrap();
    while store.step().unwrap() != firmware::store::Status::Idle {}
    let play = Request::Command(Command::Play { clip: 1, repeats: false });
    let names = PlayError::Names { found: before.names(), expected: 7 };
    assert_eq!(world.ask(0, &play), Response::Refused(Refusal::Play(names)));
    assert_eq!(world.machine.state(), State::Resting);
}

#[test]
fn a_device_says_what_clips_are_and_what_they_have_to_be() {
    let sample = sample::clip();
    let (map, clip) = (map("sample.toml", &sample.skeleton), encode(&sample));
    let mut world = World::new(&map, 1);
    assert_eq!(world.ask(0, &Request::Facts { clip: 1 }), Response::Facts(None));
    assert_eq!(world.upload(0, 1, &clip), Response::Done);
    let Response::Facts(Some(facts)) = world.ask(0, &Request::Facts { clip: 1 }) else { panic!("no facts") };
    assert_eq!((facts.frames, facts.channels, facts.rate_centihertz), (480, 31, 6_000));
    assert_eq!(facts.names, Some(map.names()), "names of the clip and of the puppet's skeleton are the same");
    let Response::Demands(demands) = world.ask(0, &Request::Demands) else { panic!("no demands") };
    assert_eq!((demands.check(&facts), demands.names), (Ok(()), map.names()));
    assert_eq!(world.ask(0, &Request::Facts { clip: LIVE }), Response::Facts(None));
}

/// All blocks are sent in order and none is lost: so what is there ends where the last one that was sent ends, also while the decoder is in
/// the middle of one.
#[test]
fn received_counts_what_has_come_while_it_plays() {
    let sample = sample::clip();
    let map = map("sample.toml", &sample.skeleton);
    // A block is a quarter of a second, and one comes each fifth: after three tenths without one the stream is lost.
    let encoding = Encoding { block_bytes: 100, ..Encoding::new(CodecId::Dpcm) };
    let encoder = Encoder::new(&sample.skeleton, &sample.motion).unwrap();
    let clip = encoder.encode(&encoding, Quality::Bits(4)).unwrap();
    let parsed = Mclip::parse(&clip, Limits::MAX).unwrap();
    let blocks: Vec<_> = parsed
        .blocks()
        .map(|block| block.unwrap())
        .map(|block| (&clip[block.at..block.end()], block.next_frame()))
        .collect();
    let header = Prefix::read(&clip).unwrap().header_bytes;
    let mut world = World::new(&map, 1);
    world.ask(0, &Request::Stream { bytes: header as u32 });
    for (part, bytes) in clip[..header].chunks(1000).enumerate() {
        world.ask(0, &Request::Header { offset: part as u32 * 1000, bytes });
    }
    let progress = |response: Response| match response {
        Response::Stream(stream) => stream.progress,
        other => panic!("{other:?}"),
    };
    let (mut sent, mut in_a_block) = (0, 0);
    let mut last = Progress::default();
    for (index, (bytes, end)) in blocks.iter().enumerate() {
        for _ in 0..if index > 1 { 10 } else { 0 } {
            world.tick(None);
            assert!(world.machine.fault().is_none(), "{last:?}");
            last = world.machine.library().live().progress();
            assert_eq!(last.received, sent, "{last:?}");
            let starts = blocks.iter().any(|(_, end)| *end == last.position);
            in_a_block += u32::from(last.position > 0 && !starts);
        }
        last = progress(world.ask(0, &Request::Packet { bytes }));
        sent = *end;
        assert_eq!(last.received, sent, "{last:?}");
        if index == 1 {
            let play = Request::Command(Command::Play { clip: LIVE, repeats: false });
            assert_eq!(world.ask(0, &play), Response::Done);
        }
    }
    assert_eq!(last.received, 480);
    assert!(in_a_block > 20, "the decoder was in the middle of a block in {in_a_block} ticks");
}
