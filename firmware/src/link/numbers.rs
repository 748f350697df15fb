//! Every number of the link, and the fields behind it.
//!
//! docs/LINK.md has the same numbers, and a test holds page and code against each other. They only grow: a number that was
//! given once is not given again, nothing is inserted, and a field is neither added, nor moved, nor of another type.

use super::clip_error::{ClipError, FIELDS};
use super::cobs_writer::CobsWriter;
use super::key::Nonce;
use super::message::{
    Answer, ClipInfo, Event, Hello, LinkCounts, Playing, Refusal, Request, Response, ServoInfo, Streaming,
    Telemetry,
};
use super::wire::{Decode, Encode, wire_enum, wire_struct};
#[cfg(test)]
use super::wire::{Described, Row};
use crate::clock::Speed;
use crate::demands::{Demands, Facts};
use crate::fault::Fault;
use crate::machine::{Command, State};
use crate::map::MAX_SERVOS;
use crate::play_error::PlayError;
use crate::store::{Name, StoreError};
use crate::stream::{Counters, Progress, StreamError};
use decoder_core::mclip::{CodecId, EntropyId};
use decoder_core::{Error, Feature, Field};
use embedded_storage::nor_flash::NorFlashErrorKind;
use heapless::{String, Vec};
use servo_wire::bus::{BusError, Reading};

wire_enum! { Request<'b> {
    0 Hello { version: u8, session: u32 },
    1 Alive,
    2 Command(command: Command),
    3 Telemetry { millis: u16 },
    4 Hold { millis: u16 },
    5 Clip { index: u16 },
    6 Begin { clip: u16, name: &'b str, bytes: u32, crc: u32 },
    7 Data { offset: u32, bytes: &'b [u8] },
    8 Commit,
    9 Abandon,
    10 Remove { clip: u16 },
    11 Stream { bytes: u32 },
    12 Header { offset: u32, bytes: &'b [u8] },
    13 Packet { bytes: &'b [u8] },
    14 Prove { proof: &'b [u8] },
    15 Facts { clip: u16 },
    16 Demands,
}}

wire_enum! { Command {
    0 Play { clip: u16, repeats: bool },
    1 Queue { clip: u16, repeats: bool },
    2 Pause,
    3 Resume,
    4 Speed(speed: Speed),
    5 Seek { frame: u32 },
    6 Sync { frame: u32, fraction: u16 },
    7 Stop,
    8 Home,
    9 Trigger,
    10 LinkLost,
    11 Acknowledge,
}}

wire_enum! { Answer {
    0 Response(response: Response),
    1 Event(event: Event),
}}

wire_enum! { Response {
    0 Hello(hello: Hello),
    1 Done,
    2 Again,
    3 Refused(refusal: Refusal),
    4 Upload { next: u32 },
    5 Clip(clip: Option<ClipInfo>),
    6 Stream(streaming: Streaming),
    7 Challenge { nonce: Nonce },
    8 Facts(facts: Option<Facts>),
    9 Demands(demands: Demands),
}}

wire_struct! { Facts { frames: u32, channels: u32, rate_centihertz: u16, names: Option<u32> }}

wire_struct! { Demands { channels: u16, names: u32, furthest_channel: u16, furthest_id: u8, tick_hz: u16 }}

wire_struct! { Hello {
    version: u8, firmware: String<16>, name: Name, servos: u8, tick_hz: u16, clock_hz: u32, data_bytes: u16,
    clip_bytes: u32, flash_stalls: bool,
}}

wire_struct! { ClipInfo { clip: u16, name: Name, bytes: u32, crc: u32, built_in: bool }}

wire_struct! { Streaming { progress: Progress, counters: Counters }}

wire_struct! { Progress { position: u32, received: u32, frames: u32, free_blocks: u16, blocks: u16 }}

wire_struct! { Counters {
    played: u32, concealed: u32, eased: u32, lost: u32, late: u32, duplicates: u32, damaged: u32, overflowed: u32,
}}

wire_enum! { Event {
    0 Telemetry(telemetry: Telemetry),
}}

wire_struct! { Telemetry {
    millis: u32, state: State, fault: Option<Fault>, playing: Option<Playing>, speed: u16, ticks: u32, missed: u32,
    busy: u32, busiest: u32, bus: Option<BusError>, stream: Option<Streaming>, link: LinkCounts,
    servos: Vec<ServoInfo, MAX_SERVOS>,
}}

wire_struct! { Playing { clip: u16, frame: u32, phase: u16 }}

wire_struct! { LinkCounts { damaged: u32, repeated: u32, unknown: u32, dropped: u32 }}

wire_struct! { ServoInfo { id: u8, goal: i32, reading: Option<Reading> }}

wire_struct! { Reading {
    position: i32, temperature: Option<u8>, millivolts: Option<u16>, load: Option<i16>, hardware_error: u8,
    torque: Option<bool>,
}}

wire_enum! { State {
    0 Finding,
    1 Reading,
    2 Arming,
    3 Opening,
    4 Easing,
    5 Playing,
    6 Stopping,
    7 Holding,
    8 Returning,
    9 Resting,
    10 Limp,
    11 Paused,
}}

wire_enum! { Refusal {
    0 NoSession,
    1 Unknown,
    2 Moving,
    3 Fault(fault: Fault),
    4 Play(error: PlayError),
    5 Store(error: StoreError),
    6 Stream(error: StreamError),
    7 NoStore,
    8 Reserved,
    9 Key,
    10 Full { hosts: u8 },
}}

wire_enum! { Fault {
    0 Silent { servo: u8 },
    1 Overheated { servo: u8 },
    2 Overloaded { servo: u8 },
    3 Voltage { servo: u8 },
    4 Hardware { servo: u8, bits: u8 },
    5 ServoWatchdog { servo: u8 },
    6 Rebooted { servo: u8 },
    7 Refused { servo: u8, error: BusError },
    8 Bus { error: BusError },
    9 LinkLost,
    10 Clip { error: Error },
    11 NoClip { clip: u16 },
    12 Late,
    13 Restarted,
}}

wire_enum! { BusError {
    0 Port,
    1 NoReply,
    2 Corrupt,
    3 Refused(number: u8),
    4 Unsupported,
    5 TooMany,
}}

wire_enum! { PlayError {
    0 Rate,
    1 NoFrames,
    2 Channel { id: u8, channel: u16, channels: u32 },
    3 Clip(error: Error),
    4 QueueFull,
    5 NoClip { clip: u16 },
    6 NoDecoder,
    7 Channels { found: u32, expected: u16 },
    8 TooFast { rate_centihertz: u16, tick_hz: u16 },
    9 Names { found: u32, expected: u32 },
    10 Beyond { frame: u32, frames: u32 },
    11 Stream,
    12 Nothing,
}}

wire_enum! { StoreError {
    0 Layout,
    1 Full { needed: u32, room: u32 },
    2 Empty,
    3 TooMany { most: u16 },
    4 Name { found: u32 },
    5 NoClip { clip: u16 },
    6 Busy,
    7 NoUpload,
    8 Gap { expected: u32, found: u32 },
    9 TooLong { bytes: u32 },
    10 Incomplete { received: u32, bytes: u32 },
    11 Checksum { found: u32, expected: u32 },
    12 Clip(error: Error),
    13 Worn { at: u32 },
    14 Flash { kind: NorFlashErrorKind, at: u32 },
    15 Play(error: PlayError),
}}

wire_enum! { StreamError {
    0 NoHeader,
    1 Playing,
    2 Clip(error: Error),
    3 TooLarge { needed: u32, room: u32 },
    4 Gap { expected: u32, found: u32 },
}}

wire_enum! { ClipError {
    0 Truncated { field: Field, at: u32, needed: u32, found: u32 },
    1 Malformed { field: Field, at: u32, found: u32, low: u32, high: u32 },
    2 Encoding { field: Field, at: u32 },
    3 Unsupported { field: Field, found: u32 },
    4 Checksum { field: Field, at: u32, found: u32, expected: u32 },
    5 Limit { field: Field, found: u32, limit: u32 },
    6 Memory { field: Field, needed: u32, lent: u32 },
    7 NotLinked { feature: Feature },
}}

wire_enum! { Feature {
    0 Codec(codec: CodecId),
    1 Part { codec: CodecId, part: u8 },
    2 Entropy(stage: EntropyId),
}}

/// Codecs and entropy stages have the numbers of docs/FORMAT.md.
macro_rules! wire_id {
    ($name:ident) => {
        impl Encode for $name {
            fn encode(&self, out: &mut CobsWriter<'_>) {
                self.id().encode(out);
            }
        }

        impl Decode<'_> for $name {
            fn decode(input: &mut &[u8]) -> Option<Self> {
                Self::from_id(u8::decode(input)?)
            }
        }
    };
}

wire_id!(CodecId);
wire_id!(EntropyId);

impl Encode for Error {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        ClipError::from(*self).encode(out);
    }
}

impl Decode<'_> for Error {
    fn decode(input: &mut &[u8]) -> Option<Self> {
        ClipError::decode(input).map(Self::from)
    }
}

/// Implements a choice without fields by its table of numbers, with what stands for one that the table does not have.
macro_rules! wire_table {
    ($name:ident, $table:expr, $other:expr) => {
        impl Encode for $name {
            fn encode(&self, out: &mut CobsWriter<'_>) {
                let number = $table.iter().find(|(_, value)| value == self).map_or($other, |row| row.0);
                number.encode(out);
            }
        }

        impl Decode<'_> for $name {
            fn decode(input: &mut &[u8]) -> Option<Self> {
                let number = u32::decode(input)?;
                $table.iter().find(|row| row.0 == number).map(|row| row.1)
            }
        }
    };
}

/// The header, where a field has no number yet.
const HEADER: u32 = 11;

wire_table!(Field, FIELDS, HEADER);

/// What a flash says, by number; all that has none is "other".
const FLASH_ERRORS: [(u32, NorFlashErrorKind); 3] =
    [(0, NorFlashErrorKind::NotAligned), (1, NorFlashErrorKind::OutOfBounds), (2, NorFlashErrorKind::Other)];

wire_table!(NorFlashErrorKind, FLASH_ERRORS, 2u32);

impl Encode for Speed {
    fn encode(&self, out: &mut CobsWriter<'_>) {
        self.parts().encode(out);
    }
}

impl Decode<'_> for Speed {
    fn decode(input: &mut &[u8]) -> Option<Self> {
        u16::decode(input).map(Self::from)
    }
}
