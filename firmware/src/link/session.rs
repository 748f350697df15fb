//! One line's conversation: requests in order and once each, telemetry when it is due, and who is gone.
//!
//! A host numbers its requests, asks again under the same number until it is answered, and only then goes on (packets of
//! a stream it sends without waiting). The device needs to remember nothing but its last response: a request with that
//! number gets it again, one with an older number nothing, and each is done once.

use super::frame::{Deframer, OVERHEAD, wire_len, write};
use super::gate::Gate;
use super::key::Lock;
use super::message::{
    ANSWER_BYTES, Answer, Event, LinkCounts, REQUEST_BYTES, RESPONSE_BYTES, Refusal, Request, Response,
    Telemetry, VERSION,
};
use super::wire::Decode;
use crate::fault::Fault;
use crate::machine::{Command, State};
use heapless::Vec;

/// Bytes that wait to be sent at most: an event, and responses to all requests of a tick.
const OUT_BYTES: usize = wire_len(ANSWER_BYTES) + REQUESTS * wire_len(RESPONSE_BYTES);

/// Requests that are carried out in a tick at most; others wait on the line.
pub const REQUESTS: usize = 4;

/// Silence in both directions, in ms, after which a host counts as gone on a line that others wait for.
pub const IDLE_MILLIS: u32 = 10_000;

/// One line's conversation. Times are in ms of any clock that goes on, and may wrap.
#[derive(Debug)]
pub struct Session {
    deframer: Deframer<{ REQUEST_BYTES + OVERHEAD }>,
    /// To be sent.
    out: Vec<u8, OUT_BYTES>,
    /// The number that the host drew.
    open: Option<u32>,
    gate: Gate,
    /// Where the host has to wait for a place: how many there are.
    guest: Option<u8>,
    /// What the device calls the session; 0: it has not been told.
    pub(crate) id: u32,
    /// Number of the last request, and what it was answered.
    last: Option<(u16, Response)>,
    heard: u32,
    hold: u16,
    telemetry: u16,
    told: u32,
    told_of: Option<(State, Option<Fault>)>,
    events: u16,
    busiest: u32,
    counts: LinkCounts,
}

impl Default for Session {
    fn default() -> Self {
        Self::new()
    }
}

impl Session {
    /// Before the first byte of a line.
    pub const fn new() -> Self {
        Self {
            deframer: Deframer::new(),
            out: Vec::new(),
            open: None,
            gate: Gate::open(),
            guest: None,
            id: 0,
            last: None,
            heard: 0,
            hold: 0,
            telemetry: 0,
            told: 0,
            told_of: None,
            events: 0,
            busiest: 0,
            counts: LinkCounts { damaged: 0, repeated: 0, unknown: 0, dropped: 0 },
        }
    }

    /// Before the first byte of a line on which only those are heard who have the key. `seed` was drawn when the device was
    /// turned on, another one each time; lines of one device have different ones.
    pub fn locked(lock: &'static dyn Lock, seed: u64) -> Self {
        let mut session = Self::new();
        session.gate = Gate::locked(lock, seed);
        session
    }

    /// The host has hung up, and another one may come: what was promised by a hold still counts, and nothing else.
    pub fn hang_up(&mut self) {
        self.deframer.forget();
        self.out.clear();
        self.gate.forget();
        (self.open, self.telemetry, self.last) = (None, 0, None);
    }

    /// All `places` are taken, or this host has one (`None`). Who has none is only heard when it says stop.
    pub const fn seat(&mut self, places: Option<u8>) {
        self.guest = places;
    }

    /// Takes bytes off the front of `bytes`, up to [`REQUESTS`] requests of them, and gives each new request to `answer`, once.
    ///
    /// Takes a step a byte and what `answer` takes. A response for which there is no room, since nobody reads, is lost: the
    /// host asks again, and what it asked was done.
    pub fn serve(&mut self, bytes: &mut &[u8], now: u32, mut answer: impl FnMut(&Request<'_>) -> Response) {
        let mut requests = 0;
        while requests < REQUESTS {
            let frame = match self.deframer.feed(bytes) {
                None => return,
                Some(Ok(frame)) => frame,
                Some(Err(_)) => {
                    self.counts.damaged = self.counts.damaged.saturating_add(1);
                    continue;
                }
            };
            requests = requests.saturating_add(1);
            self.heard = now;
            let number = frame.sequence;
            let Some(request) = parse(frame.message) else {
                self.counts.unknown = self.counts.unknown.saturating_add(1);
                send(&mut self.out, &mut self.counts, number, &refused(Refusal::Unknown));
                continue;
            };
            let known = self.open.or(self.gate.challenged());
            let begins = matches!(request, Request::Hello { session, .. } if known != Some(session));
            if !begins && known.is_some() {
                // Newer numbers are up to half of all numbers ahead.
                match self.last.as_ref().map(|(last, response)| (number.wrapping_sub(*last), response)) {
                    Some((0, response)) => {
                        self.counts.repeated = self.counts.repeated.saturating_add(1);
                        let again = Answer::Response(response.clone());
                        send(&mut self.out, &mut self.counts, number, &again);
                        continue;
                    }
                    Some((0x8000.., _)) => {
                        self.counts.repeated = self.counts.repeated.saturating_add(1);
                        continue;
                    }
                    _ => {}
                }
            }
            let response = match request {
                Request::Hello { version, session } => {
                    // What the last host promised by a hold it has to answer for.
                    (self.open, self.telemetry) = (None, 0);
                    self.gate.forget();
                    let speaks = version == VERSION;
                    match speaks.then(|| self.gate.challenge(session)).flatten() {
                        Some(nonce) => Response::Challenge { nonce },
                        None => {
                            self.open = speaks.then_some(session);
                            answer(&request)
                        }
                    }
                }
                Request::Prove { proof } => match self.gate.prove(proof) {
                    Some(session) => {
                        self.open = Some(session);
                        answer(&Request::Hello { version: VERSION, session })
                    }
                    None => Response::Refused(Refusal::Key),
                },
                _ if self.open.is_none() => Response::Refused(Refusal::NoSession),
                Request::Alive => Response::Done,
                // Whoever is there may stop the puppet.
                Request::Command(Command::Stop) => answer(&request),
                _ if let Some(hosts) = self.guest => Response::Refused(Refusal::Full { hosts }),
                Request::Hold { millis } => {
                    self.hold = millis;
                    Response::Done
                }
                Request::Telemetry { millis } => {
                    (self.telemetry, self.told_of) = (millis, None);
                    Response::Done
                }
                _ => answer(&request),
            };
            self.last = Some((number, response.clone()));
            send(&mut self.out, &mut self.counts, number, &Answer::Response(response));
        }
    }

    /// The number that the host of the session drew; none before a hello.
    pub const fn number(&self) -> Option<u32> {
        self.open
    }

    /// Time in ms since a whole frame came.
    pub const fn silent(&self, now: u32) -> u32 {
        now.wrapping_sub(self.heard)
    }

    /// Silence in ms after which the host counts as gone: [`IDLE_MILLIS`], or longer where it has said so.
    pub const fn idle_millis(&self) -> u32 {
        if self.hold as u32 > IDLE_MILLIS { self.hold as u32 } else { IDLE_MILLIS }
    }

    /// Whether someone began a session of this version.
    pub const fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Whether the host said that it has to be there.
    pub const fn is_held(&self) -> bool {
        self.hold > 0
    }

    /// Whether the host said that it has to be there, and is gone. True once.
    pub const fn lost(&mut self, now: u32) -> bool {
        let lost = self.hold > 0 && now.wrapping_sub(self.heard) > self.hold as u32;
        if lost {
            self.hold = 0;
        }
        lost
    }

    /// Whether telemetry is to be sent: it is time, or something has changed.
    pub fn telemetry_due(&self, now: u32, state: State, fault: Option<Fault>) -> bool {
        self.telemetry > 0
            && (now.wrapping_sub(self.told) >= u32::from(self.telemetry)
                || self.told_of != Some((state, fault)))
    }

    /// Notes what a tick took, for the next telemetry.
    pub fn busy(&mut self, cycles: u32) {
        self.busiest = self.busiest.max(cycles);
    }

    /// Sends telemetry, with this link's own counts. It is dropped where the line is busy.
    pub fn tell(&mut self, mut telemetry: Telemetry) {
        (self.told, self.told_of) = (telemetry.millis, Some((telemetry.state, telemetry.fault)));
        (telemetry.link, telemetry.busiest) = (self.counts, core::mem::take(&mut self.busiest));
        self.events = self.events.wrapping_add(1);
        // Responses go first.
        let room = self.out.capacity().saturating_sub(self.out.len());
        let answer = Answer::Event(Event::Telemetry(telemetry));
        if room < OUT_BYTES / 2 {
            self.counts.dropped = self.counts.dropped.saturating_add(1);
        } else {
            send(&mut self.out, &mut self.counts, self.events, &answer);
        }
    }

    /// What is to be sent.
    pub fn outgoing(&self) -> &[u8] {
        &self.out
    }

    /// Forgets the first `count` bytes of [`outgoing`](Self::outgoing), which were sent.
    pub fn sent(&mut self, count: usize) {
        let left = self.out.len().saturating_sub(count);
        for at in 0..left {
            let byte = self.out.get(at.saturating_add(count)).copied().unwrap_or_default();
            if let Some(place) = self.out.get_mut(at) {
                *place = byte;
            }
        }
        self.out.truncate(left);
    }
}

/// The request; none where the bytes are another one's, or more follow.
fn parse(message: &[u8]) -> Option<Request<'_>> {
    let mut rest = message;
    match Request::decode(&mut rest)? {
        // Those of other versions may go on.
        request @ Request::Hello { version, .. } if version != VERSION => Some(request),
        request => rest.is_empty().then_some(request),
    }
}

const fn refused(why: Refusal) -> Answer {
    Answer::Response(Response::Refused(why))
}

/// Adds a frame to what is to be sent, or counts it as dropped.
fn send(out: &mut Vec<u8, OUT_BYTES>, counts: &mut LinkCounts, number: u16, answer: &Answer) {
    let start = out.len();
    // Bytes to write into; those that were not needed go again.
    let _ = out.resize(OUT_BYTES, 0);
    let written =
        out.get_mut(start..).and_then(|free| write(number, answer, free)).map_or(0, |bytes| bytes.len());
    out.truncate(start.saturating_add(written));
    if written == 0 {
        counts.dropped = counts.dropped.saturating_add(1);
    }
}

#[cfg(test)]
mod tests;
