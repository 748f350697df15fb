//! Requests, asked until they are answered, and what the device says unasked.

use super::port::Port;
use firmware::link::frame::{Deframer, Frame, OVERHEAD, wire_len, write};
use firmware::link::key::{HmacKey, proof};
use firmware::link::message::{
    ANSWER_BYTES, Answer, Event, Hello, REQUEST_BYTES, Refusal, Request, Response, Telemetry, VERSION,
};
use firmware::link::wire::decode_all;
use firmware::machine::Command;
use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use thiserror::Error;

/// Time in which a device answers; then it is asked again.
const ANSWER_TIME: Duration = Duration::from_millis(300);

/// Time for which a device is asked again, where nothing else is said.
pub const PATIENCE: Duration = Duration::from_secs(3);

/// Time that a job of many steps may take after which nothing has changed, or more where a line has more patience.
pub const JOB_TIME: Duration = Duration::from_secs(30);

/// Events that are kept until somebody asks for them.
const EVENTS: usize = 256;

/// Why a device does not do what it was asked.
#[derive(Debug, Error)]
pub enum LinkError {
    /// The line cannot be opened.
    #[error("cannot open {port}: {error}")]
    Open {
        /// Its name.
        port: String,
        /// What the system says.
        error: io::Error,
    },
    /// The line broke.
    #[error("the line to {port} is broken: {error}")]
    Broken {
        /// Its name.
        port: String,
        /// What the system says.
        error: io::Error,
    },
    /// Nobody answers.
    #[error("{port} does not answer: asked {tries} times in {:.1} s", .time.as_secs_f64())]
    Silent {
        /// The line's name.
        port: String,
        /// How often it was asked.
        tries: u32,
        /// How long.
        time: Duration,
    },
    /// It only speaks with those who have its key.
    #[error("{port} needs a key: name the file that has it with --key-file")]
    NeedsKey {
        /// The line's name.
        port: String,
    },
    /// It speaks another version of the protocol.
    #[error(
        "{port} speaks version {device} of the link, this program version {VERSION}: bring the older one up to date"
    )]
    Version {
        /// The line's name.
        port: String,
        /// The device's version.
        device: u8,
    },
    /// It does not want to.
    #[error("{port} refuses: {refusal}")]
    Refused {
        /// The line's name.
        port: String,
        /// Why.
        refusal: Refusal,
    },
    /// It answers something else.
    #[error("{port} answers what was not asked: {found}")]
    Unexpected {
        /// The line's name.
        port: String,
        /// What.
        found: String,
    },
}

impl LinkError {
    /// Whether another try over a new line may do better.
    pub const fn is_broken(&self) -> bool {
        match self {
            Self::Broken { .. } | Self::Silent { .. } => true,
            Self::Refused { refusal, .. } => matches!(refusal, Refusal::NoSession),
            _ => false,
        }
    }
}

/// Where a device is.
#[derive(Clone, Copy, Debug)]
pub struct Line<'a> {
    /// Its port: of a serial line, or `tcp:HOST:PORT`.
    pub name: &'a str,
    /// Bits per second of a serial line.
    pub baud: u32,
    /// The key, where the line needs one.
    pub key: Option<&'a HmacKey>,
    /// Time for which a device that does not answer is asked again.
    pub patience: Duration,
}

impl<'a> From<&'a str> for Line<'a> {
    /// A line without a key, at the usual rate and with the usual patience.
    fn from(name: &'a str) -> Self {
        Self { name, baud: 115_200, key: None, patience: PATIENCE }
    }
}

/// A session with a device.
pub struct Client {
    name: String,
    patience: Duration,
    port: Port,
    deframer: Deframer<{ ANSWER_BYTES + OVERHEAD }>,
    /// Bytes that were read and not looked at.
    bytes: VecDeque<u8>,
    number: u16,
    events: VecDeque<Event>,
    hello: Hello,
}

impl Client {
    /// Opens a line ([`Port::open`]) and begins a session; proves that it has the key where the device asks.
    ///
    /// # Errors
    /// [`LinkError`]; within some seconds.
    pub fn open<'a>(line: impl Into<Line<'a>>) -> Result<Self, LinkError> {
        let Line { name, baud, key, patience } = line.into();
        let port =
            Port::open(name, baud).map_err(|error| LinkError::Open { port: name.to_owned(), error })?;
        let hello = Hello {
            version: 0,
            firmware: heapless::String::new(),
            name: heapless::String::new(),
            servos: 0,
            tick_hz: 0,
            clock_hz: 0,
            data_bytes: 0,
            clip_bytes: 0,
            flash_stalls: false,
        };
        let mut client = Self {
            name: name.to_owned(),
            patience,
            port,
            deframer: Deframer::new(),
            bytes: VecDeque::new(),
            number: 0,
            events: VecDeque::new(),
            hello,
        };
        // A zero ends what others may have left of a frame.
        client.write(&[0])?;
        // Two programs that begin in the same nanosecond are not expected.
        let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let session = time.subsec_nanos() ^ (time.as_secs() as u32).rotate_left(16) ^ std::process::id();
        let mut answer = client.request(&Request::Hello { version: VERSION, session })?;
        if let Response::Challenge { nonce } = &answer {
            let key = key.ok_or_else(|| LinkError::NeedsKey { port: name.to_owned() })?;
            answer = client.request(&Request::Prove { proof: &proof(key, nonce, session) })?;
        }
        match answer {
            Response::Hello(hello) => client.hello = hello,
            other => return Err(client.unexpected(&other)),
        }
        Ok(client)
    }

    /// Who the device is.
    pub const fn hello(&self) -> &Hello {
        &self.hello
    }

    /// The line's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Time for which the device is asked again where it does not answer.
    pub const fn patience(&self) -> Duration {
        self.patience
    }

    /// Asks until it is answered.
    ///
    /// # Errors
    /// [`LinkError`]; [`Silent`](LinkError::Silent) where nothing is answered for as long as the line's patience.
    pub fn request(&mut self, request: &Request<'_>) -> Result<Response, LinkError> {
        let start = Instant::now();
        self.number = self.number.wrapping_add(1);
        let mut buffer = [0; wire_len(REQUEST_BYTES)];
        let frame = match write(self.number, request, &mut buffer) {
            Some(frame) => &*frame,
            None => return Err(self.unexpected_text("the request is longer than a frame")),
        };
        let mut tries = 0;
        while tries == 0 || start.elapsed() < self.patience {
            tries += 1;
            self.write(frame)?;
            let until = Instant::now() + ANSWER_TIME;
            while let Some((number, answer)) = self.next_answer(until)? {
                match answer {
                    Answer::Response(Response::Refused(refusal)) if number == self.number => {
                        return Err(LinkError::Refused { port: self.name.clone(), refusal });
                    }
                    Answer::Response(response) if number == self.number => return Ok(response),
                    // To an earlier try of an earlier request.
                    Answer::Response(_) => {}
                    Answer::Event(event) => self.keep(event),
                }
            }
        }
        Err(LinkError::Silent { port: self.name.clone(), tries, time: start.elapsed() })
    }

    /// Asks for a job that takes many steps until it is done, and tells `step` of each answer.
    ///
    /// # Errors
    /// As [`request`](Self::request), and [`LinkError::Silent`] where it never ends.
    pub fn request_until_ready(&mut self, request: &Request<'_>) -> Result<Response, LinkError> {
        let start = Instant::now();
        let mut tries = 0;
        while start.elapsed() < JOB_TIME.max(self.patience) {
            tries += 1;
            match self.request(request)? {
                Response::Again => {}
                response => return Ok(response),
            }
        }
        Err(LinkError::Silent { port: self.name.clone(), tries, time: start.elapsed() })
    }

    /// Gives the puppet a command.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn command(&mut self, command: Command) -> Result<(), LinkError> {
        self.request_done(&Request::Command(command))
    }

    /// Asks for what is done at once.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn request_done(&mut self, request: &Request<'_>) -> Result<(), LinkError> {
        match self.request_until_ready(request)? {
            Response::Done => Ok(()),
            other => Err(self.unexpected(&other)),
        }
    }

    /// The telemetry that comes next, `limit` long waited for; [`Request::Telemetry`] turns it on.
    ///
    /// # Errors
    /// [`LinkError::Broken`].
    pub fn telemetry(&mut self, limit: Duration) -> Result<Option<Telemetry>, LinkError> {
        let until = Instant::now() + limit;
        loop {
            if let Some(Event::Telemetry(telemetry)) = self.events.pop_front() {
                return Ok(Some(telemetry));
            }
            match self.next_answer(until)? {
                Some((_, Answer::Event(event))) => self.keep(event),
                Some(_) => {}
                None => return Ok(None),
            }
        }
    }

    /// Forgets what the device has said unasked.
    pub fn forget_events(&mut self) {
        self.events.clear();
    }

    /// What the device is now: telemetry that was sent after this call.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn status(&mut self) -> Result<Telemetry, LinkError> {
        self.request_done(&Request::Telemetry { millis: u16::MAX })?;
        self.forget_events();
        let start = Instant::now();
        let telemetry = self.telemetry(self.patience)?;
        self.request_done(&Request::Telemetry { millis: 0 })?;
        telemetry.ok_or_else(|| LinkError::Silent {
            port: self.name.clone(),
            tries: 1,
            time: start.elapsed(),
        })
    }

    /// An error about an answer that was not expected.
    pub fn unexpected(&self, found: &Response) -> LinkError {
        self.unexpected_text(&format!("{found:?}"))
    }

    fn unexpected_text(&self, found: &str) -> LinkError {
        LinkError::Unexpected { port: self.name.clone(), found: found.to_owned() }
    }

    fn keep(&mut self, event: Event) {
        if self.events.len() == EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        self.port.write(bytes).map_err(|error| LinkError::Broken { port: self.name.clone(), error })
    }

    /// What the device says next; none at `until`.
    fn next_answer(&mut self, until: Instant) -> Result<Option<(u16, Answer)>, LinkError> {
        loop {
            let Self { deframer, bytes, name, .. } = self;
            let (mut front, _) = bytes.as_slices();
            let before = front.len();
            let frame = deframer.feed(&mut front);
            let taken = before - front.len();
            // Damaged frames are asked for again.
            let answer = frame.and_then(Result::ok).map(|frame| read(name, &frame));
            bytes.drain(..taken);
            match answer {
                Some(Ok(answer)) => return Ok(Some(answer)),
                Some(Err(error)) => return Err(error),
                None if before > 0 => continue,
                None => {}
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            let mut buffer = [0; 4096];
            let count = self
                .port
                .read(&mut buffer, left)
                .map_err(|error| LinkError::Broken { port: self.name.clone(), error })?;
            self.bytes.extend(&buffer[..count]);
        }
    }
}

/// What a frame says.
fn read(port: &str, frame: &Frame<'_>) -> Result<(u16, Answer), LinkError> {
    // An answer to a hello begins with the version in every version.
    if let [0, 0, device, ..] = *frame.message
        && device != VERSION
    {
        return Err(LinkError::Version { port: port.to_owned(), device });
    }
    let answer = decode_all(frame.message).ok_or_else(|| LinkError::Unexpected {
        port: port.to_owned(),
        found: format!("{} bytes that are no message", frame.message.len()),
    })?;
    Ok((frame.sequence, answer))
}
