//! What host and device say to each other. docs/LINK.md has each message with an example, and every number; in code the numbers
//! are in `numbers`, and [`wire`](super::wire) says how they are written.
//!
//! Every length is bounded by what holds the message: a text or slice of a request lies in the frame that brought it, and
//! all others are of `heapless`.

use super::key::Nonce;
use crate::demands::{Demands, Facts};
use crate::fault::Fault;
use crate::machine::{Command, State};
use crate::map::MAX_SERVOS;
use crate::play_error::PlayError;
use crate::store::{Name, StoreError};
use crate::stream::{Counters, Progress, StreamError};
use core::fmt;
use heapless::{String, Vec};
use serde::Serialize;
use servo_wire::bus::{BusError, Reading};

/// Version of the protocol. A device answers a hello of any version, and nothing else of another one.
pub const VERSION: u8 = 1;

/// Most bytes of a clip that one request carries: a block of 1 KiB and its header.
pub const DATA_BYTES: usize = 1040;

/// Bytes that a request takes at most: a [`Request::Data`].
pub const REQUEST_BYTES: usize = DATA_BYTES + 16;

/// Bytes that a response takes at most.
pub const RESPONSE_BYTES: usize = 160;

/// Bytes that anything from a device takes at most: telemetry of [`MAX_SERVOS`] servos.
pub const ANSWER_BYTES: usize = 128 + 32 * MAX_SERVOS;

/// What a host asks. What is asked twice under one number is done once: see [`Session`](super::session::Session).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request<'a> {
    /// Who are you? The first request of a session; answered with [`Response::Hello`] whatever the version.
    Hello {
        /// [`VERSION`] of the host.
        version: u8,
        /// A number that the host draws for this session.
        session: u32,
    },
    /// Still there: keeps a held link from being lost. Answered with [`Response::Done`].
    Alive,
    /// To the puppet, see [`Command`]; [`Command::LinkLost`] is refused.
    Command(Command),
    /// Telemetry every so many ms, and at every change of state and fault; 0 is none.
    Telemetry {
        /// Time from one to the next; a tick at least.
        millis: u16,
    },
    /// From now on silence of so many ms is [`Fault::LinkLost`]; 0 ends that.
    Hold {
        /// Silence that is borne.
        millis: u16,
    },
    /// The clip at a place of the device's list, from 0. Answered with [`Response::Clip`].
    Clip {
        /// The place.
        index: u16,
    },
    /// A clip is coming, or is to go on coming. Answered with [`Response::Upload`], or [`Response::Again`].
    Begin {
        /// Its number.
        clip: u16,
        /// Its name, [`NAME_BYTES`](crate::store::NAME_BYTES) at most.
        name: &'a str,
        /// Its size.
        bytes: u32,
        /// CRC-32 of all of it.
        crc: u32,
    },
    /// Bytes of the clip that is coming. Answered with [`Response::Upload`], or [`Response::Again`]. Bytes from elsewhere than
    /// the device waits for are not taken.
    Data {
        /// Where they begin in the clip.
        offset: u32,
        /// The bytes.
        bytes: &'a [u8],
    },
    /// The clip that was coming is whole: check it, and let it take the place of the old one. Answered with
    /// [`Response::Done`] or [`Response::Again`].
    Commit,
    /// The clip that was coming is not wanted.
    Abandon,
    /// Remove a clip. Answered with [`Response::Done`] or [`Response::Again`].
    Remove {
        /// Its number.
        clip: u16,
    },
    /// A clip will be streamed: [`LIVE`](crate::clips::LIVE) is a new clip. Answered with [`Response::Stream`].
    Stream {
        /// Bytes of its header.
        bytes: u32,
    },
    /// Bytes of that header. Answered with [`Response::Stream`].
    Header {
        /// Where they begin in the header.
        offset: u32,
        /// The bytes.
        bytes: &'a [u8],
    },
    /// One block of the streamed clip, or several, whole. Answered with [`Response::Stream`], which nobody needs to wait for.
    Packet {
        /// The bytes.
        bytes: &'a [u8],
    },
    /// That the host has the key: see [`key`](super::key). Answered with [`Response::Hello`].
    Prove {
        /// What follows from key, challenge and session.
        proof: &'a [u8],
    },
    /// What a clip says of itself. Answered with [`Response::Facts`].
    Facts {
        /// Its number.
        clip: u16,
    },
    /// What the puppet asks of clips. Answered with [`Response::Demands`].
    Demands,
}

/// What a device says.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(clippy::large_enum_variant, reason = "one at a time is made, to be written at once")]
pub enum Answer {
    /// To the request with the frame's number.
    Response(Response),
    /// Unasked; the frame's number counts these.
    Event(Event),
}

/// What a device answers a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Response {
    /// Who it is. The version comes first in every version of the protocol.
    Hello(Hello),
    /// It was done.
    Done,
    /// A step was done, which takes all the time that a tick has for it: ask again, under a new number.
    Again,
    /// It was not done.
    Refused(Refusal),
    /// A clip is coming.
    Upload {
        /// The byte that is wanted next.
        next: u32,
    },
    /// A clip of the list; none behind the last one.
    Clip(Option<ClipInfo>),
    /// How streaming goes.
    Stream(Streaming),
    /// Instead of a hello, on a line that needs a key: prove that you have it.
    Challenge {
        /// What the proof is to be about.
        nonce: Nonce,
    },
    /// What a clip says of itself; none where there is no such clip in flash or firmware.
    Facts(Option<Facts>),
    /// What the puppet asks of clips.
    Demands(Demands),
}

/// Who a device is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Hello {
    /// [`VERSION`] of the device.
    pub version: u8,
    /// Version of its firmware.
    pub firmware: String<16>,
    /// What it is called.
    pub name: Name,
    /// Servos of its puppet.
    pub servos: u8,
    /// Goals per second and servo.
    pub tick_hz: u16,
    /// Hertz of the clock that [`Telemetry::busy`] counts.
    pub clock_hz: u32,
    /// Most bytes of a [`Request::Data`].
    pub data_bytes: u16,
    /// Bytes of the largest clip for which there is room in flash now; 0 where clips cannot be uploaded.
    pub clip_bytes: u32,
    /// Whether writing flash stops everything else: then it is written only while the puppet is at rest.
    pub flash_stalls: bool,
}

/// A clip of a device.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ClipInfo {
    /// Its number.
    pub clip: u16,
    /// Its name.
    pub name: Name,
    /// Its size.
    pub bytes: u32,
    /// CRC-32 of it.
    pub crc: u32,
    /// Whether it is part of the firmware, and cannot be removed.
    pub built_in: bool,
}

/// How streaming goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Streaming {
    /// How far the stream is.
    pub progress: Progress,
    /// What has happened since it began.
    pub counters: Counters,
}

/// What a device says unasked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// How it is.
    Telemetry(Telemetry),
}

/// How a device is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Telemetry {
    /// Time in ms since it was turned on.
    pub millis: u32,
    /// What it does.
    pub state: State,
    /// What went wrong, until that is acknowledged.
    pub fault: Option<Fault>,
    /// What it plays.
    pub playing: Option<Playing>,
    /// How fast it plays, in 1/256; 0 paused.
    pub speed: u16,
    /// Ticks since it was turned on.
    pub ticks: u32,
    /// Ticks that began after the next one was due.
    pub missed: u32,
    /// Cycles of [`Hello::clock_hz`] for which the last tick kept the controller busy, bus and link included.
    pub busy: u32,
    /// The most of that since the last telemetry.
    pub busiest: u32,
    /// How goals and readings of the last tick fared.
    pub bus: Option<BusError>,
    /// How streaming goes, if it does.
    pub stream: Option<Streaming>,
    /// What was wrong on this link.
    pub link: LinkCounts,
    /// The servos, in the joint map's order.
    pub servos: Vec<ServoInfo, MAX_SERVOS>,
}

/// Where a clip is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Playing {
    /// Its number.
    pub clip: u16,
    /// The frame before the tick.
    pub frame: u32,
    /// How far the tick is from that to the next, in 1/65536.
    pub phase: u16,
}

/// What was wrong on a link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LinkCounts {
    /// Frames that arrived damaged or cut.
    pub damaged: u32,
    /// Frames that came a second time, or after a later one.
    pub repeated: u32,
    /// Frames that were whole, and no request.
    pub unknown: u32,
    /// Events that were not sent, since the link was busy.
    pub dropped: u32,
}

/// A servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ServoInfo {
    /// Its id.
    pub id: u8,
    /// Where it was told to be, in goal units.
    pub goal: i32,
    /// What it told of itself; none where it did not answer.
    pub reading: Option<Reading>,
}

/// Why a device did not do what was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Refusal {
    /// No hello of its version came before.
    NoSession,
    /// It does not know the request.
    Unknown,
    /// Its flash is written only at rest.
    Moving,
    /// It does not move before that is acknowledged.
    Fault(Fault),
    /// The clip cannot be played.
    Play(PlayError),
    /// Its clips cannot be changed in this way.
    Store(StoreError),
    /// It cannot stream that.
    Stream(StreamError),
    /// It has no flash for clips.
    NoStore,
    /// The line needs a key, and the proof is wrong or was not asked for.
    Key,
    /// As many hosts as there are places for have sessions; of others only a stop is taken.
    Full {
        /// Places.
        hosts: u8,
    },
    /// [`Command::LinkLost`] and the clip [`LIVE`](crate::clips::LIVE) are the device's own.
    Reserved,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoSession => f.write_str("no session was begun"),
            Self::Unknown => f.write_str("the device does not know this request"),
            Self::Moving => {
                f.write_str("the device writes its flash only while the puppet is at rest; stop it first")
            }
            Self::Fault(fault) => write!(f, "a fault is latched: {fault}; acknowledge it first"),
            Self::Play(error) => error.fmt(f),
            Self::Store(error) => error.fmt(f),
            Self::Stream(error) => error.fmt(f),
            Self::NoStore => f.write_str("the device has no flash for clips"),
            Self::Key => f.write_str("the key is not the device's"),
            Self::Full { hosts } => write!(
                f,
                "{hosts} hosts are connected already, and of others the device only takes a stop; end one of them, or wait: \
                 one that says nothing and hears nothing is let go after {} s",
                super::session::IDLE_MILLIS / 1000
            ),
            Self::Reserved => f.write_str("this command or clip number is the device's own"),
        }
    }
}

impl core::error::Error for Refusal {}
