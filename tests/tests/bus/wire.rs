//! A simulated half-duplex wire: a UART, a direction pin and a timer on one side, servos on the other, time in
//! nanoseconds that passes only when nobody can go on, and a fault at one packet.

use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use embedded_io_async::{ErrorKind, ErrorType};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::rc::Rc;

/// What hangs on the wire.
pub trait Servos {
    /// Takes bytes that end at `now_ns`; returns what the servos send, each packet with the pause before it.
    fn hear(&mut self, bytes: &[u8], now_ns: u64) -> Vec<(u64, Vec<u8>)>;

    /// Makes length and checksum right again after a packet's content was changed.
    fn seal(&self, packet: &mut [u8]);

    /// Position of the id in a packet, and of the low byte of its length.
    fn places(&self) -> (usize, usize);

    /// The packet as the refusal of the servo that sent it.
    fn refuse(&self, packet: &[u8], number: u8) -> Vec<u8>;

    /// From `now_ns` on the line of one of the servos is loose for so many microseconds: it neither hears nor says anything.
    fn loosen(&mut self, _servo: usize, _micros: u64, _now_ns: u64) {
        panic!("no servo here has a line of its own");
    }
}

/// What happens to one packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It never arrives.
    Drop,
    /// It arrives twice, one right behind the other.
    Duplicate,
    /// It arrives again, this many microseconds later.
    Again(u64),
    /// It arrives this many microseconds late.
    Delay(u64),
    /// Only so many bytes arrive; counted from the end where negative.
    Truncate(isize),
    /// A bit is wrong.
    Flip(usize),
    /// A byte is missing.
    Lose(usize),
    /// Noise comes before it.
    Noise,
    /// The sender hears it too.
    Echo,
    /// Another id, with the right checksum.
    WrongId(u8),
    /// Another length, with the checksum it had.
    BadLength(u8),
    /// Another length, with the right checksum: the packet is as long as it says.
    Resized(i8),
    /// From here on the line reads as zeros for so many microseconds, and nothing passes.
    StuckLow(u64),
    /// As stuck low, and the UART reports errors without end instead.
    Broken(u64),
    /// The servo refuses with this error number.
    Refused(u8),
    /// From before this packet on the line of this servo is loose for so many microseconds.
    Loose(usize, u64),
}

/// Bytes that are remembered.
const HEARD: usize = 2000;

struct State<S> {
    now: u64,
    byte_ns: u64,
    driving: bool,
    echo: bool,
    /// What is being sent, and when its last byte is out.
    sending: Vec<u8>,
    sent_at: u64,
    /// Bytes on their way to the UART, by time.
    coming: VecDeque<(u64, u8)>,
    /// Next moment at which one that waits can go on.
    next: u64,
    reads: u32,
    /// Each packet so far, and whether a servo sent it.
    packets: Vec<(bool, Vec<u8>)>,
    fault: Option<(usize, Fault)>,
    /// When the fault happened.
    struck: Option<u64>,
    stuck_until: u64,
    broken: bool,
    zero_at: u64,
    /// Whether packets may be cut by releasing the bus.
    cut: bool,
    down: u64,
    up: u64,
    /// The last bytes that the UART gave out.
    heard: VecDeque<u8>,
    servos: S,
}

/// The wire; the halves of a port are clones of it.
pub struct Wire<S>(Rc<RefCell<State<S>>>);

impl<S> Clone for Wire<S> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<S: Servos> State<S> {
    fn stuck(&self) -> bool {
        self.now < self.stuck_until
    }

    /// The packet as it gets through: pieces, each with the pause before it. The number of packets counts up.
    fn through(&mut self, packet: &[u8], from_servo: bool) -> Vec<(u64, Vec<u8>)> {
        let position = self.packets.len();
        self.packets.push((from_servo, packet.to_vec()));
        let whole = packet.to_vec();
        let Some((_, fault)) = self.fault.filter(|(at, _)| *at == position) else { return vec![(0, whole)] };
        self.struck = Some(self.now);
        let (id, length) = self.servos.places();
        let mut changed = whole.clone();
        match fault {
            Fault::Drop => return vec![],
            Fault::Duplicate => return vec![(0, whole.clone()), (0, whole)],
            Fault::Again(micros) => return vec![(0, whole.clone()), (1000 * micros, whole)],
            Fault::Delay(micros) => return vec![(1000 * micros, whole)],
            Fault::Truncate(len @ 0..) => changed.truncate(len as usize),
            Fault::Truncate(len) => changed.truncate(changed.len().saturating_sub(len.unsigned_abs())),
            Fault::Flip(bit) => {
                let bit = bit % (8 * changed.len());
                changed[bit / 8] ^= 1 << (bit % 8);
            }
            Fault::Lose(byte) => {
                changed.remove(byte % whole.len());
            }
            Fault::Noise => {
                changed.splice(0..0, [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x30, 0xFF, 0xFF, 0x55]);
            }
            Fault::Echo if !from_servo => {
                for &byte in packet {
                    self.coming.push_back((self.now, byte));
                }
            }
            Fault::WrongId(other) => {
                changed[id] = other;
                self.servos.seal(&mut changed);
            }
            Fault::BadLength(other) => changed[length] = other,
            Fault::Resized(by) => {
                let body = changed.len() - 2;
                match by {
                    1.. => (0..by).for_each(|_| changed.insert(body, 0)),
                    _ => {
                        let cut = usize::from(by.unsigned_abs()).min(body.saturating_sub(length + 2));
                        changed.drain(body - cut..body);
                    }
                }
                self.servos.seal(&mut changed);
            }
            Fault::StuckLow(micros) | Fault::Broken(micros) => {
                self.stuck_until = self.now + 1000 * micros;
                self.broken = matches!(fault, Fault::Broken(_));
                self.coming.clear();
                return vec![];
            }
            Fault::Refused(number) if from_servo => changed = self.servos.refuse(packet, number),
            Fault::Loose(servo, micros) => self.servos.loosen(servo, micros, self.now),
            Fault::Refused(_) | Fault::Echo => {}
        }
        vec![(0, changed)]
    }

    /// The packet is out: the servos hear it and answer.
    fn deliver(&mut self) {
        let mut packet = core::mem::take(&mut self.sending);
        let start = self.sent_at - packet.len() as u64 * self.byte_ns;
        self.down += packet.len() as u64;
        if self.echo {
            for (place, &byte) in packet.iter().enumerate() {
                self.coming.push_back((start + (place as u64 + 1) * self.byte_ns, byte));
            }
        }
        if self.stuck() {
            return;
        }
        // Two that talk at once destroy each other.
        let before = self.coming.len();
        if !self.echo {
            let byte_ns = self.byte_ns;
            self.coming.retain(|(at, _)| *at < start || *at - byte_ns > self.sent_at);
        }
        if self.coming.len() != before && !packet.is_empty() {
            let middle = packet.len() / 2;
            packet[middle] ^= 0x5A;
        }
        for (pause, piece) in self.through(&packet, false) {
            let answers = self.servos.hear(&piece, self.now + pause);
            let mut at = self.now + pause;
            for (pause, answer) in answers {
                at += pause;
                let sent = self.through(&answer, true);
                if self.stuck() {
                    break;
                }
                for (late, piece) in sent {
                    self.up += piece.len() as u64;
                    let mut arrives = at + late;
                    for byte in piece {
                        arrives += self.byte_ns;
                        let place = self.coming.partition_point(|(time, _)| *time <= arrives);
                        self.coming.insert(place, (arrives, byte));
                    }
                }
                at += answer.len() as u64 * self.byte_ns;
            }
        }
    }
}

impl<S: Servos> Wire<S> {
    pub fn new(servos: S, baud: u64) -> Self {
        Self(Rc::new(RefCell::new(State {
            now: 0,
            byte_ns: 10_000_000_000 / baud,
            driving: false,
            echo: false,
            sending: Vec::new(),
            sent_at: 0,
            coming: VecDeque::new(),
            next: u64::MAX,
            reads: 0,
            packets: Vec::new(),
            fault: None,
            struck: None,
            stuck_until: 0,
            broken: false,
            zero_at: 0,
            cut: false,
            down: 0,
            up: 0,
            heard: VecDeque::new(),
            servos,
        })))
    }

    /// Lets the UART hear all it sends.
    pub fn with_echo(self) -> Self {
        self.0.borrow_mut().echo = true;
        self
    }

    /// Has the fault happen to the packet that is the `at`th of both directions.
    pub fn with_fault(self, at: usize, fault: Fault) -> Self {
        self.0.borrow_mut().fault = Some((at, fault));
        self
    }

    /// Lets a packet be cut by releasing the bus, as a call that is cancelled does.
    pub fn let_cut(&self) {
        self.0.borrow_mut().cut = true;
    }

    pub fn now_us(&self) -> u64 {
        self.0.borrow().now / 1000
    }

    /// When the fault happened, if it has.
    pub fn struck_us(&self) -> Option<u64> {
        self.0.borrow().struck.map(|nanos| nanos / 1000)
    }

    /// Packets of both directions so far, as they were sent, and whether a servo sent them.
    pub fn packets(&self) -> Vec<(bool, Vec<u8>)> {
        self.0.borrow().packets.clone()
    }

    /// Bytes from and to the port so far.
    pub fn bytes(&self) -> (u64, u64) {
        let state = self.0.borrow();
        (state.down, state.up)
    }

    /// The last bytes that the port was given.
    pub fn heard(&self) -> Vec<u8> {
        self.0.borrow().heard.iter().copied().collect()
    }

    pub fn servos<R>(&self, with: impl FnOnce(&mut S) -> R) -> R {
        with(&mut self.0.borrow_mut().servos)
    }

    /// Lets time pass.
    pub fn wait_us(&self, micros: u64) {
        self.0.borrow_mut().now += 1000 * micros;
    }

    /// Puts bytes on the wire that arrive now.
    pub fn inject(&self, bytes: &[u8]) {
        let mut state = self.0.borrow_mut();
        let now = state.now;
        state.coming.extend(bytes.iter().map(|&byte| (now, byte)));
    }

    /// Runs to the end, letting time pass; returns the result and the microseconds it took.
    ///
    /// Panics where nothing would ever go on, and where something goes on without time.
    pub fn run<R>(&self, future: impl Future<Output = R>) -> (R, u64) {
        let start = self.0.borrow().now;
        let mut future = pin!(future);
        loop {
            {
                let mut state = self.0.borrow_mut();
                (state.next, state.reads) = (u64::MAX, 0);
            }
            if let Poll::Ready(result) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
                let state = self.0.borrow();
                assert!(!state.driving, "the bus is left driven");
                return (result, (state.now - start).div_ceil(1000));
            }
            let mut state = self.0.borrow_mut();
            assert!(state.next != u64::MAX, "a hang: nothing will ever happen");
            state.now = state.next.max(state.now);
        }
    }
}

impl<S> ErrorType for Wire<S> {
    type Error = ErrorKind;
}

impl<S: Servos> embedded_io_async::Read for Wire<S> {
    async fn read(&mut self, buf: &mut [u8]) -> Result<usize, ErrorKind> {
        poll_fn(|_| {
            let state = &mut *self.0.borrow_mut();
            state.reads += 1;
            assert!(state.reads < 100_000, "a hang: reads without end");
            if state.stuck() {
                if state.broken {
                    return Poll::Ready(Err(ErrorKind::InvalidData));
                }
                if state.zero_at <= state.now {
                    state.zero_at = state.now + state.byte_ns;
                    buf[0] = 0;
                    return Poll::Ready(Ok(1));
                }
                state.next = state.next.min(state.zero_at);
                return Poll::Pending;
            }
            let mut count = 0;
            while count < buf.len()
                && let Some(&(at, byte)) = state.coming.front()
                && at <= state.now
            {
                buf[count] = byte;
                count += 1;
                state.coming.pop_front();
                state.heard.push_back(byte);
            }
            if count > 0 {
                let old = state.heard.len().saturating_sub(HEARD);
                state.heard.drain(..old);
                return Poll::Ready(Ok(count));
            }
            if let Some((at, _)) = state.coming.front() {
                state.next = state.next.min(*at);
            }
            Poll::Pending
        })
        .await
    }
}

impl<S: Servos> embedded_io_async::Write for Wire<S> {
    async fn write(&mut self, buf: &[u8]) -> Result<usize, ErrorKind> {
        let state = &mut *self.0.borrow_mut();
        assert!(state.driving, "sent while receiving");
        state.sent_at = state.sent_at.max(state.now) + buf.len() as u64 * state.byte_ns;
        state.sending.extend(buf);
        Ok(buf.len())
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        poll_fn(|_| {
            let state = &mut *self.0.borrow_mut();
            if state.now < state.sent_at {
                state.next = state.next.min(state.sent_at);
                return Poll::Pending;
            }
            state.deliver();
            Poll::Ready(Ok(()))
        })
        .await
    }
}

impl<S> embedded_hal::digital::ErrorType for Wire<S> {
    type Error = Infallible;
}

impl<S> embedded_hal::digital::OutputPin for Wire<S> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        let mut state = self.0.borrow_mut();
        if state.now < state.sent_at {
            assert!(state.cut, "released the bus before the last byte was out");
            state.sending.clear();
            state.sent_at = state.now;
        }
        state.driving = false;
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().driving = true;
        Ok(())
    }
}

impl<S> embedded_hal_async::delay::DelayNs for Wire<S> {
    async fn delay_ns(&mut self, ns: u32) {
        let end = self.0.borrow().now + u64::from(ns);
        poll_fn(|_| {
            let mut state = self.0.borrow_mut();
            if state.now >= end {
                return Poll::Ready(());
            }
            state.next = state.next.min(end);
            Poll::Pending
        })
        .await;
    }
}
