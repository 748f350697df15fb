//! The frames of docs/LINK.md.

use super::frame::write;
use super::message::{
    Answer, ClipInfo, Event, Hello, LinkCounts, Playing, Refusal, Request, Response, ServoInfo, Streaming,
    Telemetry, VERSION,
};
use super::wire::Encode;
use crate::clips::LIVE;
use crate::clock::Speed;
use crate::demands::{Demands, Facts};
use crate::fault::Fault;
use crate::machine::{Command, State};
use crate::stream::{Counters, Progress};
use servo_wire::bus::Reading;
use std::fmt::Write;
use std::string::String;

fn line(table: &mut String, what: &str, number: u16, message: &impl Encode) {
    let mut buffer = [0; 200];
    let frame = write(number, message, &mut buffer).unwrap();
    let hex: Vec<String> = frame.iter().map(|byte| std::format!("{byte:02x}")).collect();
    writeln!(table, "| {what} | {number} | `{}` |", hex.join(" ")).unwrap();
}

fn requests(table: &mut String) {
    let requests = [
        ("hello, session 0x12345678", Request::Hello { version: VERSION, session: 0x1234_5678 }),
        ("alive", Request::Alive),
        ("play clip 3", Request::Command(Command::Play { clip: 3, repeats: false })),
        ("queue clip 4, repeated", Request::Command(Command::Queue { clip: 4, repeats: true })),
        ("pause", Request::Command(Command::Pause)),
        ("speed 1.5", Request::Command(Command::Speed(Speed::new(384)))),
        ("seek frame 600", Request::Command(Command::Seek { frame: 600 })),
        ("sync to frame 600.5", Request::Command(Command::Sync { frame: 600, fraction: 0x8000 })),
        ("stop", Request::Command(Command::Stop)),
        ("acknowledge", Request::Command(Command::Acknowledge)),
        ("telemetry every 100 ms", Request::Telemetry { millis: 100 }),
        ("hold 500 ms", Request::Hold { millis: 500 }),
        ("clip 0 of the list", Request::Clip { index: 0 }),
        (
            "begin clip 3, \"walk\", 5494 bytes",
            Request::Begin { clip: 3, name: "walk", bytes: 5494, crc: 0xb840_538a },
        ),
        ("data at 512", Request::Data { offset: 512, bytes: &[0, 1, 2, 3] }),
        ("commit", Request::Commit),
        ("abandon", Request::Abandon),
        ("remove clip 3", Request::Remove { clip: 3 }),
        ("stream, header of 583 bytes", Request::Stream { bytes: 583 }),
        ("header at 0", Request::Header { offset: 0, bytes: b"MCLP" }),
        ("packet", Request::Packet { bytes: &[9; 4] }),
        ("play the stream", Request::Command(Command::Play { clip: LIVE, repeats: false })),
        ("resume", Request::Command(Command::Resume)),
        ("home", Request::Command(Command::Home)),
        ("trigger", Request::Command(Command::Trigger)),
        ("link lost", Request::Command(Command::LinkLost)),
        ("prove", Request::Prove { proof: &[7; 32] }),
        ("facts of clip 3", Request::Facts { clip: 3 }),
        ("demands", Request::Demands),
    ];
    for (number, (what, request)) in (1..).zip(&requests) {
        line(table, what, number * 10, request);
    }
}

fn answers(table: &mut String) {
    let hello = Hello {
        version: VERSION,
        firmware: "0.1.0".try_into().unwrap(),
        name: "virtual".try_into().unwrap(),
        servos: 12,
        tick_hz: 50,
        clock_hz: 1_000_000,
        data_bytes: 512,
        clip_bytes: 1_040_384,
        flash_stalls: false,
    };
    let clip = ClipInfo {
        clip: 3,
        name: "walk".try_into().unwrap(),
        bytes: 5494,
        crc: 0xb840_538a,
        built_in: false,
    };
    let progress = Progress { position: 60, received: 300, frames: 2251, free_blocks: 2, blocks: 7 };
    let stream = Streaming { progress, counters: Counters { played: 60, ..Counters::default() } };
    let facts = Facts { frames: 2251, channels: 62, rate_centihertz: 12_000, names: Some(0x0102_0304) };
    let demands =
        Demands { channels: 62, names: 0x0102_0304, furthest_channel: 60, furthest_id: 12, tick_hz: 50 };
    let responses = [
        ("hello", Response::Hello(hello)),
        ("done", Response::Done),
        ("again", Response::Again),
        ("refused: link lost is latched", Response::Refused(Refusal::Fault(Fault::LinkLost))),
        ("upload: byte 512 is wanted", Response::Upload { next: 512 }),
        ("clip 3, \"walk\"", Response::Clip(Some(clip))),
        ("no more clips", Response::Clip(None)),
        ("stream", Response::Stream(stream)),
        ("challenge", Response::Challenge { nonce: (0..16).collect() }),
        ("facts of a clip", Response::Facts(Some(facts))),
        ("no such clip", Response::Facts(None)),
        ("demands", Response::Demands(demands)),
    ];
    for (number, (what, response)) in (1..).zip(responses) {
        line(table, what, number * 10, &Answer::Response(response));
    }
    let reading = Reading {
        position: 2040,
        temperature: Some(30),
        millivolts: Some(12_000),
        load: Some(-5),
        hardware_error: 0,
        torque: Some(true),
    };
    let servos = [
        ServoInfo { id: 1, goal: 2048, reading: Some(reading) },
        ServoInfo { id: 2, goal: -7, reading: None },
    ];
    let telemetry = Telemetry {
        millis: 6541,
        state: State::Playing,
        fault: None,
        playing: Some(Playing { clip: 3, frame: 146, phase: 0x4000 }),
        speed: 256,
        ticks: 328,
        missed: 0,
        busy: 210,
        busiest: 280,
        bus: None,
        stream: None,
        link: LinkCounts::default(),
        servos: servos.into_iter().collect(),
    };
    line(table, "telemetry of two servos", 1, &Answer::Event(Event::Telemetry(telemetry)));
}

/// The page.
pub(super) fn document() -> String {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/LINK.md");
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn the_document_has_these_frames() {
    let mut table = String::from("| from the host | number | bytes |\n|---|---:|---|\n");
    requests(&mut table);
    table.push_str("\n| from the device | number | bytes |\n|---|---:|---|\n");
    answers(&mut table);
    let document = document();
    let found = document.split_once("\n## Examples\n").unwrap().1;
    let found = found.split_once("\n| from the host").map_or("", |(_, rest)| rest);
    let found = found.split("\n### ").next().unwrap_or("");
    assert!(
        std::format!("| from the host{found}").trim_end() == table.trim_end(),
        "the examples of docs/LINK.md are not these:\n{table}"
    );
}
