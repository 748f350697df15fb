//! What answers a host: machine, clips in flash and a live stream behind a link. Boards and the virtual device share it.
//!
//! A board gives [`Device::tick`] once a tick what has passed, and then each of its lines to [`Device::serve`]. All work on
//! flash is one bounded step a tick ([`Store::step`], or the pages of one request), and a request is answered in the tick
//! in which it is read: where more steps are needed with [`Response::Again`].

use crate::clips::Clips;
use crate::collect::{collect, numbered};
use crate::fault::Feedback;
use crate::library::LIVE;
use crate::link::message::{
    ClipInfo, Hello, LinkCounts, Playing, Refusal, Request, Response, ServoInfo, Streaming, Telemetry,
    VERSION,
};
use crate::link::session::Session;
use crate::machine::{Command, Machine};
use crate::store::{MappedFlash, Name, Status, Store, StoreError};

/// What a device says of itself.
#[derive(Clone, Debug)]
pub struct Identity {
    /// What it is called.
    pub name: Name,
    /// Hertz of the clock that [`Device::tick`] is given cycles of.
    pub clock_hz: u32,
    /// Most bytes of an upload that are written in a tick.
    pub data_bytes: u16,
    /// Whether writing flash stops everything else (flash that the code runs from). Then it is written only while the puppet
    /// is at rest, and in every second tick, so that no ticks in a row are late.
    pub flash_stalls: bool,
}

/// Time in ms after the last word about it for which an upload belongs to its session alone.
pub const UPLOAD_MILLIS: u32 = 2_000;

/// Whose the store's work is.
#[derive(Clone, Copy, Debug)]
struct Owner {
    /// The session, as the device counts them; 0: nobody's.
    session: u32,
    /// When it said something about that last.
    heard: u32,
}

/// What the store is doing for a host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Job {
    None,
    Upload { clip: u16, bytes: u32, crc: u32 },
    Commit,
    Remove { clip: u16 },
}

/// A puppet's side of its links.
#[derive(Debug)]
pub struct Device {
    identity: Identity,
    job: Job,
    owner: Owner,
    /// Sessions so far.
    sessions: u32,
    /// How the job ended.
    ended: Option<Result<(), StoreError>>,
    /// Whether flash was written in this tick.
    wrote: bool,
    /// What every link is told. Its servos are filled in when they are asked for.
    millis: u32,
    ticks: u32,
    missed: u32,
    busy: u32,
}

impl Device {
    /// A device that was turned on.
    pub const fn new(identity: Identity) -> Self {
        Self {
            identity,
            job: Job::None,
            owner: Owner { session: 0, heard: 0 },
            sessions: 0,
            ended: None,
            wrote: false,
            millis: 0,
            ticks: 0,
            missed: 0,
            busy: 0,
        }
    }

    /// Once a tick, before the links are served: goes on with work on flash by a step, and looks whether the live stream has
    /// ended without its end.
    ///
    /// `millis` is the time since the device was turned on, `busy` the cycles of [`Identity::clock_hz`] that the last tick took.
    pub fn tick<F: MappedFlash, const N: usize>(
        &mut self,
        machine: &mut Machine<'_, Clips<'_, '_, F>, N>,
        feedback: &Feedback<'_>,
        millis: u32,
        busy: u32,
    ) {
        let passed = u16::try_from(millis.wrapping_sub(self.millis)).unwrap_or(u16::MAX);
        self.millis = millis;
        self.ticks = self.ticks.wrapping_add(1);
        self.missed = self.missed.saturating_add(u32::from(feedback.late));
        self.busy = busy;
        let live = machine.library().live();
        // Where the buffer is full nobody can send.
        let waits = live.progress().free_blocks > 0;
        if live.lost(if waits { passed } else { 0 }) {
            // What is not there cannot be gone on with after an acknowledgement.
            let _ = machine.command(Command::Stop);
            let _ = machine.command(Command::LinkLost);
        }
        let rests = core::mem::take(&mut self.wrote) && self.identity.flash_stalls;
        if !rests && self.may_write(machine) {
            self.work(machine);
        }
    }

    /// Takes what has come on a line off the front of `bytes` and answers it; [`Session::outgoing`] is then to be sent. `bytes` that are
    /// left are to be given again in the next tick.
    pub fn serve<F: MappedFlash, const N: usize>(
        &mut self,
        session: &mut Session,
        bytes: &mut &[u8],
        machine: &mut Machine<'_, Clips<'_, '_, F>, N>,
        feedback: &Feedback<'_>,
    ) {
        let now = self.millis;
        session.busy(self.busy);
        let (mut open, mut id) = (session.number(), session.id);
        session.serve(bytes, now, |request| {
            if let Request::Hello { session, .. } = *request
                && open != Some(session)
            {
                open = Some(session);
                self.sessions = self.sessions.wrapping_add(1).max(1);
                id = self.sessions;
            }
            self.answer(id, request, machine).unwrap_or_else(Response::Refused)
        });
        session.id = id;
        if session.lost(now) {
            let _ = machine.command(Command::LinkLost);
        }
        if session.telemetry_due(now, machine.state(), machine.fault()) {
            session.tell(self.telemetry(machine, feedback));
        }
    }

    fn may_write<F: MappedFlash, const N: usize>(&self, machine: &Machine<'_, Clips<'_, '_, F>, N>) -> bool {
        !self.identity.flash_stalls || machine.at_rest()
    }

    /// A step of what the store is doing.
    fn work<F: MappedFlash, const N: usize>(&mut self, machine: &mut Machine<'_, Clips<'_, '_, F>, N>) {
        let Some(store) = machine.library().store() else { return };
        if matches!(store.status(), Status::Idle | Status::Receiving { .. }) {
            return;
        }
        self.wrote = true;
        match store.step() {
            Ok(Status::Idle) => self.ended = Some(Ok(())),
            Ok(_) => {}
            Err(error) => self.ended = Some(Err(error)),
        }
    }

    fn answer<F: MappedFlash, const N: usize>(
        &mut self,
        session: u32,
        request: &Request<'_>,
        machine: &mut Machine<'_, Clips<'_, '_, F>, N>,
    ) -> Result<Response, Refusal> {
        let writes = matches!(
            request,
            Request::Begin { .. } | Request::Data { .. } | Request::Commit | Request::Remove { .. }
        );
        if writes && !self.may_write(machine) {
            return Err(Refusal::Moving);
        }
        match *request {
            // The stream's number.
            Request::Begin { clip: LIVE, .. } => Err(Refusal::Reserved),
            Request::Hello { .. } => Ok(Response::Hello(self.hello(machine))),
            Request::Command(command) => command_machine(command, machine),
            Request::Clip { index } => Ok(Response::Clip(info(machine.library(), index))),
            Request::Stream { bytes } => {
                machine.library().live().begin(bytes).map_err(Refusal::Stream)?;
                Ok(streaming(machine.library()))
            }
            Request::Header { offset, bytes } => {
                machine.library().live().header(offset, bytes).map_err(Refusal::Stream)?;
                Ok(streaming(machine.library()))
            }
            Request::Packet { bytes } => {
                machine.library().live().receive(bytes).map_err(Refusal::Stream)?;
                Ok(streaming(machine.library()))
            }
            Request::Begin { .. }
            | Request::Data { .. }
            | Request::Commit
            | Request::Abandon
            | Request::Remove { .. } => {
                let demands = machine.map().demands();
                let store = machine.library().store().ok_or(Refusal::NoStore)?;
                store.demand(demands);
                self.own(session, request, store.status()).map_err(Refusal::Store)?;
                self.change(request, store).map_err(Refusal::Store)
            }
            Request::Facts { clip } => Ok(Response::Facts(machine.library().facts(clip))),
            Request::Demands => Ok(Response::Demands(machine.map().demands())),
            // The session's own.
            Request::Alive | Request::Telemetry { .. } | Request::Hold { .. } | Request::Prove { .. } => {
                Ok(Response::Done)
            }
        }
    }

    /// Whether a session may go on with the store's work: it is its own, or nobody's any more. What was done of that is for who
    /// begins, not for who goes on with it.
    fn own(&mut self, session: u32, request: &Request<'_>, status: Status) -> Result<(), StoreError> {
        if self.owner.session != session {
            let rests = self.millis.wrapping_sub(self.owner.heard) > UPLOAD_MILLIS;
            if status != Status::Idle && !rests {
                return Err(StoreError::Busy);
            }
            if matches!(request, Request::Data { .. } | Request::Commit) {
                return Err(StoreError::NoUpload);
            }
        }
        self.owner = Owner { session, heard: self.millis };
        Ok(())
    }

    /// Changes to the clips in flash. Each may be asked again and again.
    fn change<F: MappedFlash>(
        &mut self,
        request: &Request<'_>,
        store: &mut Store<F>,
    ) -> Result<Response, StoreError> {
        match *request {
            Request::Begin { clip, name, bytes, crc } => {
                let job = Job::Upload { clip, bytes, crc };
                if self.job != job || store.status() == Status::Idle {
                    store.begin(clip, name, bytes, crc)?;
                    (self.job, self.ended) = (job, None);
                }
                Ok(progress(store.status()))
            }
            Request::Data { offset, bytes } => {
                if !matches!(self.job, Job::Upload { .. }) {
                    return Err(StoreError::NoUpload);
                }
                self.failed()?;
                // One write a tick.
                if self.wrote || !matches!(store.status(), Status::Receiving { .. }) {
                    return Ok(Response::Again);
                }
                self.wrote = true;
                match store.write(offset, bytes) {
                    Ok(next) | Err(StoreError::Gap { expected: next, .. }) => Ok(Response::Upload { next }),
                    Err(error) => Err(error),
                }
            }
            Request::Commit => match self.job {
                Job::Upload { .. } => {
                    self.failed()?;
                    store.commit()?;
                    self.job = Job::Commit;
                    Ok(Response::Again)
                }
                Job::Commit => self.end(),
                Job::None | Job::Remove { .. } => Err(StoreError::NoUpload),
            },
            Request::Remove { clip } => {
                let job = Job::Remove { clip };
                if self.job == job {
                    return self.end();
                }
                store.remove(clip)?;
                (self.job, self.ended) = (job, None);
                Ok(Response::Again)
            }
            _ => {
                store.abandon()?;
                (self.job, self.ended) = (Job::None, None);
                Ok(Response::Done)
            }
        }
    }

    /// How a job ended, if it has.
    fn end(&self) -> Result<Response, StoreError> {
        match self.ended {
            None => Ok(Response::Again),
            Some(result) => result.map(|()| Response::Done),
        }
    }

    /// Why an upload failed, if it has.
    fn failed(&self) -> Result<(), StoreError> {
        self.ended.unwrap_or(Ok(()))
    }

    fn hello<F: MappedFlash, const N: usize>(&self, machine: &mut Machine<'_, Clips<'_, '_, F>, N>) -> Hello {
        let map = machine.map();
        Hello {
            version: VERSION,
            firmware: env!("CARGO_PKG_VERSION").try_into().unwrap_or_default(),
            name: self.identity.name.clone(),
            servos: u8::try_from(map.joints().len()).unwrap_or(u8::MAX),
            tick_hz: map.tick_hz(),
            clock_hz: self.identity.clock_hz,
            data_bytes: self.identity.data_bytes,
            clip_bytes: machine.library().store().map_or(0, |store| store.room()),
            flash_stalls: self.identity.flash_stalls,
        }
    }

    fn telemetry<F: MappedFlash, const N: usize>(
        &self,
        machine: &mut Machine<'_, Clips<'_, '_, F>, N>,
        feedback: &Feedback<'_>,
    ) -> Telemetry {
        let live = machine.library().live();
        let stream = Streaming { progress: live.progress(), counters: live.counters() };
        let playing = machine.mixer().position();
        let servos = machine.goals().iter().zip(feedback.readings);
        let servos = collect(servos.map(|(goal, reading)| ServoInfo {
            id: goal.id,
            goal: goal.position,
            reading: *reading,
        }));
        Telemetry {
            millis: self.millis,
            state: machine.state(),
            fault: machine.fault(),
            playing: playing.map(|(clip, frame, phase)| Playing { clip, frame, phase }),
            speed: machine.mixer().speed().parts(),
            ticks: self.ticks,
            missed: self.missed,
            busy: self.busy,
            // The link's own, as its counts.
            busiest: 0,
            bus: feedback.bus.err(),
            stream: (stream.progress.frames > 0).then_some(stream),
            link: LinkCounts::default(),
            servos,
        }
    }
}

fn command_machine<F: MappedFlash, const N: usize>(
    command: Command,
    machine: &mut Machine<'_, Clips<'_, '_, F>, N>,
) -> Result<Response, Refusal> {
    match (command, machine.fault()) {
        (Command::LinkLost, _) => return Err(Refusal::Reserved),
        (Command::Play { .. } | Command::Queue { .. } | Command::Trigger, Some(fault)) => {
            return Err(Refusal::Fault(fault));
        }
        _ => {}
    }
    machine.command(command).map(|()| Response::Done).map_err(Refusal::Play)
}

/// How far an upload is.
fn progress(status: Status) -> Response {
    match status {
        Status::Receiving { received } => Response::Upload { next: received },
        _ => Response::Again,
    }
}

fn streaming<F: MappedFlash>(clips: &Clips<'_, '_, F>) -> Response {
    let live = clips.live();
    Response::Stream(Streaming { progress: live.progress(), counters: live.counters() })
}

/// A place of the list: the clips in flash, then those linked in that they do not hide.
fn info<F: MappedFlash>(clips: &mut Clips<'_, '_, F>, index: u16) -> Option<ClipInfo> {
    let linked = clips.linked();
    let mut count = 0;
    if let Some(store) = clips.store() {
        for entry in store.list() {
            if count == index {
                let (clip, name, bytes, crc) = (entry.clip, entry.name, entry.bytes, entry.crc);
                return Some(ClipInfo { clip, name, bytes, crc, built_in: false });
            }
            count = count.saturating_add(1);
        }
    }
    let hidden =
        |clips: &mut Clips<'_, '_, F>, clip| clips.store().is_some_and(|store| store.entry(clip).is_some());
    for (clip, bytes) in numbered(linked).map(|(clip, bytes)| (clip as u16, bytes)) {
        if hidden(clips, clip) {
            continue;
        }
        if count == index {
            let (name, crc) =
                (Name::try_from("built in").unwrap_or_default(), crate::link::frame::crc32([*bytes]));
            let bytes = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
            return Some(ClipInfo { clip, name, bytes, crc, built_in: true });
        }
        count = count.saturating_add(1);
    }
    None
}
