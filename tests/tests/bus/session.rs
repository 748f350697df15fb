//! A puppet's session on any bus: find, arm, torque on, play, restart a servo, play on. What a player does, with checks.

use crate::servos1::{Kind, Protocol1};
use crate::servos2::XSeries;
use crate::wire::{Fault, Servos, Wire};
use servo_wire::bus::{BusError, Goal, Reading, ServoBus};
use servo_wire::dynamixel::{self, DynamixelBus};
use servo_wire::feetech::{FeetechBus, Series};
use servo_wire::port::{LineConfig, Port};
use servo_wire::protocol1::{self, Protocol1Bus};

/// Ticks from the restart on, the last of which must find all well.
const SETTLE: u32 = 20;
const TICK_US: u64 = 10_000;

/// What the checks want to know of simulated servos.
pub trait Look: Servos {
    fn goal(&self, index: usize) -> i32;
    fn goals(&self, index: usize) -> &[i32];
    fn complaints(&self) -> &[String];
}

impl Look for XSeries {
    fn goal(&self, index: usize) -> i32 {
        self.servos[index].goal()
    }
    fn goals(&self, index: usize) -> &[i32] {
        &self.servos[index].goals
    }
    fn complaints(&self) -> &[String] {
        &self.complaints
    }
}

impl Look for Protocol1 {
    fn goal(&self, index: usize) -> i32 {
        self.servos[index].goal()
    }
    fn goals(&self, index: usize) -> &[i32] {
        &self.servos[index].goals
    }
    fn complaints(&self) -> &[String] {
        &self.complaints
    }
}

/// Longest times in microseconds that the buses state.
#[derive(Clone, Copy)]
pub struct Limits {
    pub single: u64,
    pub write: u64,
    pub read: u64,
}

pub struct Rig<S, B> {
    pub wire: Wire<S>,
    pub bus: B,
    pub ids: Vec<u8>,
    pub limits: Limits,
    /// Positions of servo `index` are `span · index` up to the next.
    pub span: i32,
}

pub type Port2<S> = Port<Wire<S>, Wire<S>, Wire<S>>;
pub type Bus2 = DynamixelBus<Wire<XSeries>, Wire<XSeries>, Wire<XSeries>>;

pub const BAUD: u32 = 1_000_000;
pub const IDS: [u8; 5] = [0, 1, 3, 20, 252];

pub fn port<S: Servos>(wire: &Wire<S>, line: LineConfig) -> Port2<S> {
    Port::new(wire.clone(), wire.clone(), wire.clone(), line)
}

pub fn wire<S: Servos>(servos: S, fault: Option<(usize, Fault)>, line: LineConfig) -> Wire<S> {
    let wire = Wire::new(servos, line.baud.into());
    let wire = if line.echo { wire.with_echo() } else { wire };
    match fault {
        Some((at, fault)) => wire.with_fault(at, fault),
        None => wire,
    }
}

pub fn line(echo: bool) -> LineConfig {
    LineConfig { echo, ..LineConfig::uart(BAUD) }
}

/// As [`dynamixel`], by plain Sync Read.
pub fn dynamixel_plain(ids: &[u8], line: LineConfig, fault: Option<(usize, Fault)>) -> Rig<XSeries, Bus2> {
    let Rig { wire, bus, ids, limits, span } = dynamixel(ids, line, fault);
    Rig { wire, bus: bus.with_plain_reads(), ids, limits, span }
}

pub fn dynamixel(ids: &[u8], line: LineConfig, fault: Option<(usize, Fault)>) -> Rig<XSeries, Bus2> {
    let wire = wire(XSeries::new(ids), fault, line);
    for index in 0..ids.len() {
        wire.servos(|servos| servos.servos[index].set_position(1000 * index as i32 + 500));
    }
    Rig {
        bus: DynamixelBus::new(dynamixel::DynamixelClient::new(port(&wire, line))),
        ids: ids.to_vec(),
        limits: Limits {
            single: Bus2::single_limit_us(&line, 1).into(),
            write: Bus2::write_limit_us(&line, ids.len()).into(),
            read: Bus2::read_limit_us(&line, ids.len()).into(),
        },
        span: 1000,
        wire,
    }
}

fn servos1(kind: Kind, span: i32, line: LineConfig, fault: Option<(usize, Fault)>) -> Wire<Protocol1> {
    let servos: Vec<(u8, u16)> =
        IDS.iter().enumerate().map(|(index, &id)| (id, (span * index as i32 + span / 2) as u16)).collect();
    wire(Protocol1::new(kind, &servos), fault, line)
}

pub fn ax(line: LineConfig, fault: Option<(usize, Fault)>) -> Rig<Protocol1, impl ServoBus> {
    let wire = servos1(Kind::Ax, 200, line, fault);
    type Bus = Protocol1Bus<Wire<Protocol1>, Wire<Protocol1>, Wire<Protocol1>>;
    Rig {
        bus: Protocol1Bus::new(protocol1::Protocol1Client::<_, _, _, 192>::new(port(&wire, line))),
        ids: IDS.to_vec(),
        limits: Limits {
            single: line.exchange_limit_us(8, 26, 1).into(),
            write: line.exchange_limit_us(8 + 3 * IDS.len(), 0, 0).into(),
            read: Bus::read_limit_us(&line, IDS.len()).into(),
        },
        span: 200,
        wire,
    }
}

pub fn feetech(
    series: Series,
    line: LineConfig,
    fault: Option<(usize, Fault)>,
) -> Rig<Protocol1, impl ServoBus> {
    let (kind, span) = match series {
        Series::Sts => (Kind::Sts, 700),
        Series::Scs => (Kind::Scs, 200),
    };
    let wire = servos1(kind, span, line, fault);
    type Bus = FeetechBus<Wire<Protocol1>, Wire<Protocol1>, Wire<Protocol1>>;
    Rig {
        bus: FeetechBus::new(protocol1::Protocol1Client::<_, _, _, 192>::new(port(&wire, line)), series),
        ids: IDS.to_vec(),
        limits: Limits {
            single: line.exchange_limit_us(8, 32, 1).into(),
            write: line.exchange_limit_us(8 + 3 * IDS.len(), 0, 0).into(),
            read: Bus::read_limit_us(&line, IDS.len()).into(),
        },
        span,
        wire,
    }
}

impl<S: Look, B: ServoBus> Rig<S, B> {
    /// Calls until it succeeds, every 10 ms.
    fn insist(
        &mut self,
        limit: u64,
        what: &str,
        mut call: impl AsyncFnMut(&mut B, &[u8]) -> Result<(), BusError>,
    ) -> Result<(), String> {
        for _ in 0..8 {
            let (result, took) = self.wire.run(call(&mut self.bus, &self.ids));
            if took > limit {
                return Err(format!("{what} took {took} µs of {limit}"));
            }
            match result {
                Ok(()) | Err(BusError::Unsupported) => return Ok(()),
                Err(_) => self.wire.wait_us(TICK_US - took.min(TICK_US)),
            }
        }
        Err(format!("{what} never succeeds"))
    }

    fn torque(&mut self, index: usize) -> Result<(), String> {
        let single = self.limits.single;
        self.insist(single, "torque", async |bus, ids| bus.set_torque(ids, index, true).await)
    }

    fn goal(&self, index: usize, tick: u32) -> i32 {
        self.span * index as i32 + tick as i32
    }

    /// Writes goals, reads, checks; puts torque back where a servo has lost it.
    fn tick(&mut self, tick: u32, torque: bool) -> Result<Vec<Option<Reading>>, String> {
        let start = self.wire.now_us();
        let goals: Vec<Goal> =
            self.ids.iter().enumerate().map(|(i, &id)| Goal { id, position: self.goal(i, tick) }).collect();
        let (_, took) = self.wire.run(self.bus.write_goals(&goals));
        if took > self.limits.write {
            return Err(format!("goals took {took} µs of {}", self.limits.write));
        }
        let mut readings = vec![None; self.ids.len()];
        let (result, took) = self.wire.run(self.bus.read_all(&self.ids, &mut readings));
        if took > self.limits.read {
            return Err(format!("reading took {took} µs of {}", self.limits.read));
        }
        if result.is_err() && readings.iter().any(Option::is_some) {
            return Err(format!("{result:?} with readings"));
        }
        for (index, reading) in readings.iter().enumerate() {
            let Some(reading) = reading else { continue };
            if reading.position / self.span != index as i32 || reading.millivolts != Some(12_100) {
                return Err(format!("servo {index} has another's reading: {reading:?}"));
            }
            if torque && reading.torque == Some(false) {
                self.torque(index)?;
            }
        }
        let spent = self.wire.now_us() - start;
        self.wire.wait_us(TICK_US.saturating_sub(spent));
        Ok(readings)
    }

    /// The session; returns the packets until the last ticks, which are without fault.
    pub fn play(&mut self) -> Result<usize, String> {
        let single = self.limits.single;
        for index in 0..self.ids.len() {
            self.insist(3 * single, "ping", async |bus, ids| bus.ping(ids, index).await)?;
        }
        let all = 2 * self.ids.len() as u64 * single;
        self.insist(all, "watchdog", async |bus, ids| bus.set_watchdog(ids, 400).await)?;
        self.tick(1, false)?;
        for index in 0..self.ids.len() {
            self.torque(index)?;
        }
        for tick in 2..6 {
            self.tick(tick, true)?;
        }
        self.insist(single, "reboot", async |bus, ids| bus.reboot(ids, 2).await)?;
        for tick in 6..9 {
            self.tick(tick, true)?;
        }
        let packets = self.wire.packets().len();
        let mut last = Vec::new();
        for tick in 9..9 + SETTLE {
            last = self.tick(tick, true)?;
        }
        let tick = 8 + SETTLE;
        for (index, reading) in last.into_iter().enumerate() {
            let goal = self.goal(index, tick);
            let Some(reading) = reading else { return Err(format!("servo {index} stays silent")) };
            let good =
                reading.position == goal && reading.hardware_error == 0 && reading.torque == Some(true);
            let held = self.wire.servos(|servos| servos.goal(index));
            if !good || held != goal {
                return Err(format!("servo {index} ends at {held} with {reading:?}, expected {goal}"));
            }
            let legal = |position: &i32| (1..=tick).any(|tick| self.goal(index, tick) == *position);
            let goals = self.wire.servos(|servos| servos.goals(index).to_vec());
            if let Some(stray) = goals.iter().find(|goal| !legal(goal)) {
                return Err(format!("servo {index} was sent to {stray}"));
            }
        }
        Ok(packets)
    }
}
