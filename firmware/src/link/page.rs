//! docs/LINK.md against the code: its tables of numbers and fields, and golden bytes of every number of an error.

use super::clip_error::{ClipError, FIELDS};
use super::examples::document;
use super::frame::{Deframer, write};
use super::key::{KEY_BYTES, NONCE_BYTES, PROOF_BYTES};
use super::message::{
    ANSWER_BYTES, Answer, ClipInfo, DATA_BYTES, Event, Hello, LinkCounts, Playing, REQUEST_BYTES,
    RESPONSE_BYTES, Refusal, Request, Response, ServoInfo, Streaming, Telemetry,
};
use super::session::{IDLE_MILLIS, REQUESTS};
use super::wire::{Decode, Described, Encode, Row, decode_all};
use crate::clock::{MAX_FRAMES_PER_TICK, Speed};
use crate::demands::{Demands, Facts};
use crate::device::UPLOAD_MILLIS;
use crate::fault::Fault;
use crate::machine::{Command, State};
use crate::map::MAX_SERVOS;
use crate::mixer::{PAUSE_MILLIS, QUEUE};
use crate::play_error::PlayError;
use crate::playback::SEEK_FRAMES;
use crate::store::{NAME_BYTES, StoreError};
use crate::stream::{Counters, MOST_BLOCKS, Progress, StreamError};
use core::fmt::Debug;
use decoder_core::mclip::{CodecId, EntropyId};
use decoder_core::{Error, Feature, Field};
use embedded_storage::nor_flash::NorFlashErrorKind;
use servo_wire::bus::{BusError, Reading};
use std::collections::BTreeSet;

/// `LinkLost` and `link_lost` in words.
fn words(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(if letter == '_' { ' ' } else { letter }.to_lowercase());
    }
    words
}

/// How the page names a type.
fn type_name(name: &str) -> String {
    let name = name.replace(' ', "");
    if let Some(inner) = name.strip_prefix("Option<").and_then(|inner| inner.strip_suffix('>')) {
        return format!("option of {}", type_name(inner));
    }
    match name.as_str() {
        "&'bstr" | "String<16>" | "Name" => "text".to_owned(),
        "&'b[u8]" | "Nonce" => "bytes".to_owned(),
        "Vec<ServoInfo,MAX_SERVOS>" => "list of servo info".to_owned(),
        "Speed" => "u16".to_owned(),
        "Error" => "clip error".to_owned(),
        "NorFlashErrorKind" => "flash error".to_owned(),
        "CodecId" | "EntropyId" => "u8".to_owned(),
        name => words(name),
    }
}

/// The cells of a table, without its last column, which is for people.
fn table(page: &str, heading: &str) -> Vec<Vec<String>> {
    let start = format!("\n### {heading}\n");
    let (_, section) = page.split_once(&start).unwrap_or_else(|| panic!("no heading {heading}"));
    let section = section.split("\n#").next().unwrap();
    let rows = section.lines().filter(|line| line.starts_with('|')).skip(2);
    rows.map(|row| {
        let cells: Vec<String> =
            row.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
        cells[..cells.len() - 1].to_vec()
    })
    .collect()
}

fn expected(rows: &[Row]) -> Vec<Vec<String>> {
    let field = |(name, kind): &(&str, &str)| (words(name), format!("`{}`", type_name(kind)));
    let mut expected = Vec::new();
    for row in rows {
        let fields = row.fields.iter().map(field);
        match row.number {
            Some(number) => {
                let fields: Vec<String> = fields.map(|(name, kind)| format!("{name} {kind}")).collect();
                expected.push(vec![number.to_string(), words(row.name), fields.join(", ")]);
            }
            None => expected.extend(fields.map(|(name, kind)| vec![name, kind])),
        }
    }
    expected
}

/// Numbers count from 0 without a gap, so that nobody can take one out.
fn check<T: Described>(page: &str, heading: &str, told: &mut BTreeSet<String>) {
    let numbers = T::ROWS.iter().filter_map(|row| row.number);
    assert!(numbers.clone().eq(0..numbers.count() as u32), "{heading}: numbers go up by one");
    assert_eq!(table(page, heading), expected(T::ROWS), "docs/LINK.md, {heading}");
    for (_, kind) in T::ROWS.iter().flat_map(|row| row.fields) {
        told.insert(type_name(kind).replace("option of ", "").replace("list of ", ""));
    }
}

#[test]
fn the_page_has_every_number_and_every_field() {
    let page = document();
    let mut told = BTreeSet::new();
    let mut sections: BTreeSet<String> =
        ["u8", "u16", "u32", "i16", "i32", "bool", "text", "bytes"].map(String::from).into();
    macro_rules! all {
        ($($type:ty, $heading:literal;)*) => {$(
            check::<$type>(&page, $heading, &mut told);
            sections.insert($heading.to_lowercase());
        )*};
    }
    all! {
        Request<'_>, "Request"; Command, "Command"; Answer, "Answer"; Response, "Response"; Hello, "Hello";
        ClipInfo, "Clip info"; Facts, "Facts"; Demands, "Demands"; Streaming, "Streaming"; Progress, "Progress"; Counters, "Counters"; Event, "Event";
        Telemetry, "Telemetry"; Playing, "Playing"; LinkCounts, "Link counts"; ServoInfo, "Servo info"; Reading, "Reading";
        State, "State"; Refusal, "Refusal"; Fault, "Fault"; BusError, "Bus error"; PlayError, "Play error";
        StoreError, "Store error"; StreamError, "Stream error"; ClipError, "Clip error"; Feature, "Feature";
    }
    let by_number = |rows: &mut dyn Iterator<Item = (u32, String)>| -> Vec<Vec<String>> {
        rows.map(|(number, name)| vec![number.to_string(), words(&name)]).collect()
    };
    assert_eq!(
        table(&page, "Field"),
        by_number(&mut FIELDS.iter().map(|(n, field)| (*n, format!("{field:?}"))))
    );
    sections.extend(["field", "flash error"].map(String::from));
    assert_eq!(table(&page, "Flash error"), [["0", "not aligned"], ["1", "out of bounds"], ["2", "other"]]);
    assert!(told.is_subset(&sections), "the page explains no {:?}", told.difference(&sections));
}

#[test]
fn the_pages_figures_are_those_of_the_code() {
    let page = document();
    let (_, section) = page.split_once("\n## Figures\n").unwrap();
    let table = section.split("\n\n| figure of").next().unwrap();
    let found: Vec<(String, u32)> = table
        .lines()
        .filter(|line| line.starts_with('|'))
        .skip(2)
        .map(|row| {
            let (name, value) = row.trim_matches('|').split_once('|').unwrap();
            (name.trim().to_owned(), value.trim().parse().unwrap())
        })
        .collect();
    let expected = [
        ("most bytes of a request", REQUEST_BYTES as u32),
        ("most bytes of a response", RESPONSE_BYTES as u32),
        ("most bytes of an event", ANSWER_BYTES as u32),
        ("most bytes of `data`, `header` and `packet`", DATA_BYTES as u32),
        ("most bytes of a name", NAME_BYTES as u32),
        ("requests a tick and line", REQUESTS as u32),
        ("servos of telemetry", MAX_SERVOS as u32),
        ("clips that wait in the queue", QUEUE as u32),
        ("blocks of a stream that wait", MOST_BLOCKS as u32),
        ("least speed", Speed::SLOWEST.parts().into()),
        ("most speed", Speed::FASTEST.parts().into()),
        ("ms of a ramp of 256 in speed", PAUSE_MILLIS.into()),
        ("frames a tick at most", MAX_FRAMES_PER_TICK.into()),
        ("frames that a seek decodes a tick", SEEK_FRAMES),
        ("ms after which an upload is nobody's", UPLOAD_MILLIS),
        ("ms after which a silent host is gone", IDLE_MILLIS),
        ("least bytes of a key", *KEY_BYTES.start() as u32),
        ("most bytes of a key", *KEY_BYTES.end() as u32),
        ("bytes of a nonce", NONCE_BYTES as u32),
        ("bytes of a proof", PROOF_BYTES as u32),
    ];
    assert_eq!(found, expected.map(|(name, value)| (name.to_owned(), value)));
}

#[test]
fn a_row_that_differs_is_found() {
    let page =
        "\n### Command\n\n| no. | name | fields | what |\n|---|---|---|---|\n| 0 | play | clip `u32` | |\n";
    assert_ne!(table(page, "Command")[0], expected(Command::ROWS)[0]);
    assert_eq!(table(page, "Command"), [["0", "play", "clip `u32`"]]);
}

/// Every number of every error once.
fn errors() -> Vec<Refusal> {
    let field = Field::Payload;
    let features = [
        Feature::Codec(CodecId::Dpcm),
        Feature::Part { codec: CodecId::Adpcm, part: 1 },
        Feature::Entropy(EntropyId::Huffman),
    ];
    let clip = [
        Error::Truncated { field: Field::Frames, at: 1, needed: 200, found: 3 },
        Error::Malformed { field: Field::Words, at: 4, found: 5, low: 6, high: u32::MAX },
        Error::Encoding { field, at: 70_000 },
        Error::Unsupported { field: Field::Version, found: 8 },
        Error::Checksum { field, at: 9, found: 10, expected: 11 },
        Error::Limit { field: Field::Channels, found: 12, limit: 13 },
        Error::OutputTooSmall { field: Field::States, needed: 14, lent: 15 },
    ];
    let bus = [
        BusError::Port,
        BusError::NoReply,
        BusError::Corrupt,
        BusError::Refused(16),
        BusError::Unsupported,
        BusError::TooMany,
    ];
    let play = [
        PlayError::Rate,
        PlayError::NoFrames,
        PlayError::Channel { id: 17, channel: 18, channels: 19 },
        PlayError::QueueFull,
        PlayError::NoClip { clip: 20 },
        PlayError::NoDecoder,
        PlayError::Channels { found: 21, expected: 22 },
        PlayError::TooFast { rate_centihertz: 12_000, tick_hz: 7 },
        PlayError::Names { found: 48, expected: 49 },
        PlayError::Beyond { frame: 50, frames: 51 },
        PlayError::Stream,
        PlayError::Nothing,
    ];
    let error = Error::Encoding { field, at: 23 };
    let store = [
        StoreError::Layout,
        StoreError::Full { needed: 24, room: 25 },
        StoreError::Empty,
        StoreError::TooMany { most: 26 },
        StoreError::Name { found: 27 },
        StoreError::NoClip { clip: 28 },
        StoreError::Busy,
        StoreError::NoUpload,
        StoreError::Gap { expected: 29, found: 30 },
        StoreError::TooLong { bytes: 31 },
        StoreError::Incomplete { received: 32, bytes: 33 },
        StoreError::Checksum { found: 34, expected: 35 },
        StoreError::Clip(error),
        StoreError::Worn { at: 36 },
        StoreError::Flash { kind: NorFlashErrorKind::NotAligned, at: 37 },
        StoreError::Flash { kind: NorFlashErrorKind::OutOfBounds, at: 38 },
        StoreError::Flash { kind: NorFlashErrorKind::Other, at: 39 },
        StoreError::Play(PlayError::Nothing),
    ];
    let stream = [
        StreamError::NoHeader,
        StreamError::Playing,
        StreamError::Clip(error),
        StreamError::TooLarge { needed: 40, room: 41 },
        StreamError::Gap { expected: 42, found: 43 },
    ];
    let servo = 44;
    let faults = [
        Fault::Silent { servo },
        Fault::Overheated { servo },
        Fault::Overloaded { servo },
        Fault::Voltage { servo },
        Fault::Hardware { servo, bits: 45 },
        Fault::ServoWatchdog { servo },
        Fault::Rebooted { servo },
        Fault::Refused { servo, error: BusError::Corrupt },
        Fault::LinkLost,
        Fault::Clip { error },
        Fault::NoClip { clip: 46 },
        Fault::Late,
        Fault::Restarted,
    ];
    let own = [
        Refusal::NoSession,
        Refusal::Unknown,
        Refusal::Moving,
        Refusal::NoStore,
        Refusal::Reserved,
        Refusal::Key,
        Refusal::Full { hosts: 4 },
    ];
    let faults = faults.into_iter().chain(bus.map(|error| Fault::Bus { error }));
    let clip = clip.into_iter().chain(features.map(|feature| Error::NotLinked { feature }));
    let play = play.into_iter().chain(clip.map(PlayError::Clip));
    own.into_iter()
        .chain(faults.map(Refusal::Fault))
        .chain(play.map(Refusal::Play))
        .chain(store.map(Refusal::Store))
        .chain(stream.map(Refusal::Stream))
        .collect()
}

/// A message in bytes, which is read back.
fn bytes<T: Encode + for<'b> Decode<'b> + PartialEq + Debug>(message: &T) -> Vec<u8> {
    let mut buffer = [0; 300];
    let mut frame: &[u8] = write(0, message, &mut buffer).unwrap();
    let mut deframer = Deframer::<300>::new();
    let bytes = deframer.feed(&mut frame).unwrap().unwrap().message.to_vec();
    assert_eq!(decode_all::<T>(&bytes).as_ref(), Some(message));
    assert!(decode_all::<T>(&[&bytes[..], &[0]].concat()).is_none());
    bytes
}

/// The bytes were frozen with those of the first version, which postcard made from the order of variants.
#[test]
fn the_page_has_every_error_in_bytes() {
    let page = document();
    let table = table(&page, "Errors in bytes");
    let expected: Vec<Vec<String>> = errors()
        .iter()
        .map(|refusal| {
            let hex: Vec<String> = bytes(refusal).iter().map(|byte| format!("{byte:02x}")).collect();
            vec![format!("`{}`", hex.join(" "))]
        })
        .collect();
    assert_eq!(table, expected);
}

#[test]
fn states_are_their_numbers() {
    use State::{
        Arming, Easing, Finding, Holding, Limp, Opening, Paused, Playing, Reading, Resting, Returning,
        Stopping,
    };
    let all = [
        Finding, Reading, Arming, Opening, Easing, Playing, Stopping, Holding, Returning, Resting, Limp,
        Paused,
    ];
    for (number, state) in (0..).zip(all) {
        assert_eq!(bytes(&state), [number]);
    }
}

#[test]
fn what_is_no_number_is_no_message() {
    for (bytes, is_one) in [
        (&[2u8, 11][..], true),
        (&[2, 12], false),
        (&[14], false),
        (&[16], true),
        (&[17], false),
        (&[2, 0, 0xff, 0xff, 3, 1], true),
        (&[2, 0, 0xff, 0xff, 3, 2], false),
        (&[2, 0, 0xff, 0xff, 4, 1], false),
        (&[0x80, 0x80, 0x80, 0x80, 0x80, 0], false),
        (&[0xff, 0xff, 0xff, 0xff, 0x1f], false),
        (&[7, 0, 3, 1, 2], false),
        (&[6, 0, 1, 0xff, 0, 0], false),
        (&[], false),
    ] {
        assert_eq!(decode_all::<Request<'_>>(bytes).is_some(), is_one, "{bytes:?}");
    }
}
