//! The servo bus of any protocol on a serial port.

use super::serial::{RealTime, Serial};
use anyhow::{Result, bail};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};
use firmware::map::{BusKind, BusSpec, MAX_BUSES};
use puppet_file::Map;
use servo_wire::blender::BlenderBus;
use servo_wire::bus::{BusError, Reading, ServoBus};
use servo_wire::dynamixel::DynamixelBus;
use servo_wire::feetech::{FeetechBus, Series};
use servo_wire::impl_servo_bus;
use servo_wire::joined::JoinedBuses;
use servo_wire::port::{Automatic, LineConfig, Port};
use servo_wire::protocol1::Protocol1Bus;
use servo_wire::{dynamixel, protocol1};

/// What a USB adapter and an operating system may be late, in microseconds: 16 ms are the usual latency timer.
pub const SLACK_US: u32 = 20_000;

/// How often a servo is asked that does not answer, where no tick waits for it. An answer may be lost, and a busy computer
/// may be late for several of them: a third of a second in all.
pub const TRIES: usize = 15;

/// Longest that servos wait before they answer as they leave the factory, in microseconds.
pub const RETURN_DELAY_US: u32 = 500;

/// A bus on a serial port, or on another line.
pub enum SerialBus<S = Serial, T = RealTime> {
    /// Dynamixel protocol 2.0.
    Dynamixel(Box<DynamixelBus<S, Automatic, T>>),
    /// Dynamixel protocol 1.0.
    Dynamixel1(Box<Protocol1Bus<S, Automatic, T>>),
    /// Feetech STS or SCS.
    Feetech(Box<FeetechBus<S, Automatic, T>>),
    /// Blender Servo Animation's live frames.
    Blender(Box<BlenderBus<S, T>>),
}

/// The buses of a puppet as one.
pub type Buses = JoinedBuses<SerialBus, MAX_BUSES>;

/// Who a servo says it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Model number.
    pub model: u16,
    /// Version of its firmware; of a Feetech servo, 100 times its first number and its second.
    pub firmware: u16,
}

impl SerialBus {
    /// Opens `path` for a bus of this kind.
    ///
    /// # Errors
    /// A sentence where the kind has no serial port, or the port cannot be opened.
    pub fn open(spec: BusSpec, path: &str) -> Result<Self> {
        let BusSpec { kind, baud } = spec;
        if matches!(kind, BusKind::Pwm | BusKind::Pca9685) {
            bail!("servos on {} hang on a board's pins, not on a serial port", kind.name());
        }
        let line =
            LineConfig { slack_us: SLACK_US, return_delay_us: RETURN_DELAY_US, ..LineConfig::uart(baud) };
        Ok(Self::on(kind, Serial::open(path, baud)?, RealTime, line))
    }
}

impl<S: Read + Write, T: DelayNs> SerialBus<S, T> {
    /// A bus of this kind on a line; one of pins is taken for Dynamixel protocol 2.0.
    pub fn on(kind: BusKind, serial: S, delay: T, line: LineConfig) -> Self {
        if kind == BusKind::Blender {
            return Self::Blender(Box::new(BlenderBus::new(serial, delay, line.baud)));
        }
        let port = Port::new(serial, Automatic, delay, line);
        match kind {
            BusKind::Dynamixel1 => {
                Self::Dynamixel1(Box::new(Protocol1Bus::new(protocol1::Protocol1Client::new(port))))
            }
            BusKind::Sts | BusKind::Scs => {
                let series = if kind == BusKind::Sts { Series::Sts } else { Series::Scs };
                Self::Feetech(Box::new(FeetechBus::new(protocol1::Protocol1Client::new(port), series)))
            }
            _ => Self::Dynamixel(Box::new(DynamixelBus::new(dynamixel::DynamixelClient::new(port)))),
        }
    }

    /// Asks a servo who it is; changes nothing in it.
    ///
    /// # Errors
    /// [`BusError::NoReply`] where there is none, [`BusError::Unsupported`] where servos cannot be read.
    pub async fn identify(&mut self, id: u8) -> Result<Identity, BusError> {
        match self {
            Self::Dynamixel(bus) => {
                let ping = bus.client().ping(id).await?;
                Ok(Identity { model: ping.model, firmware: ping.firmware.into() })
            }
            // Model (2 bytes), firmware, id.
            Self::Dynamixel1(bus) => {
                let mut data = [0; 4];
                bus.client().read(id, 0, &mut data).await?;
                let [low, high, firmware, own] = data;
                let identity = Identity { model: u16::from_le_bytes([low, high]), firmware: firmware.into() };
                if own == id { Ok(identity) } else { Err(BusError::Corrupt) }
            }
            // Firmware (2 bytes), byte order, model (2 bytes), id.
            Self::Feetech(bus) => {
                let mut data = [0; 6];
                bus.client().read(id, 0, &mut data).await?;
                let [major, minor, _, low, high, own] = data;
                let firmware = u16::from(major) * 100 + u16::from(minor);
                let identity = Identity { model: u16::from_le_bytes([low, high]), firmware };
                if own == id { Ok(identity) } else { Err(BusError::Corrupt) }
            }
            Self::Blender(_) => Err(BusError::Unsupported),
        }
    }

    /// Whether a servo answers a ping, which it does whatever its Status Return Level is.
    pub async fn is_there(&mut self, id: u8) -> bool {
        match self {
            Self::Dynamixel(bus) => bus.client().ping(id).await.is_ok(),
            Self::Dynamixel1(bus) => bus.client().ping(id).await.is_ok_and(is_answer),
            Self::Feetech(bus) => bus.client().ping(id).await.is_ok_and(is_answer),
            Self::Blender(_) => false,
        }
    }

    /// Reads the bytes of a servo's table from `address` on.
    ///
    /// # Errors
    /// [`BusError`]; [`BusError::Unsupported`] where servos cannot be read, or have no such address.
    pub async fn read_registers(&mut self, id: u8, address: u16, data: &mut [u8]) -> Result<(), BusError> {
        let short = u8::try_from(address).map_err(|_| BusError::Unsupported);
        match self {
            Self::Dynamixel(bus) => bus.client().read(id, address, data).await.map(drop),
            Self::Dynamixel1(bus) => bus.client().read(id, short?, data).await.map(drop),
            Self::Feetech(bus) => bus.client().read(id, short?, data).await.map(drop),
            Self::Blender(_) => Err(BusError::Unsupported),
        }
    }

    /// Writes bytes into a servo's table from `address` on.
    ///
    /// # Errors
    /// [`BusError`]; [`BusError::Unsupported`] where servos have no table, or no such address.
    pub async fn write_registers(&mut self, id: u8, address: u16, data: &[u8]) -> Result<(), BusError> {
        let short = u8::try_from(address).map_err(|_| BusError::Unsupported);
        match self {
            Self::Dynamixel(bus) => bus.client().write(id, address, data).await.map(drop),
            Self::Dynamixel1(bus) => bus.client().write(id, short?, data).await.map(drop),
            Self::Feetech(bus) => bus.client().write(id, short?, data).await.map(drop),
            Self::Blender(_) => Err(BusError::Unsupported),
        }
    }

    /// Asks all servos at once who they are, where the protocol can: gives those that answered.
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn identify_all(&mut self) -> Result<Vec<(u8, Identity)>, BusError> {
        let mut found = Vec::new();
        if let Self::Dynamixel(bus) = self {
            let each = |id, ping: dynamixel::client::Ping| {
                found.push((id, Identity { model: ping.model, firmware: ping.firmware.into() }));
            };
            bus.client().broadcast_ping(each).await?;
        }
        Ok(found)
    }

    /// How many servos have this id. Asks for what they measure, in which no two are alike: where they talk at once, what is heard is
    /// no answer.
    ///
    /// # Errors
    /// [`BusError::NoReply`] where there is none, [`BusError::Corrupt`] where several talk at once.
    pub async fn count_answers(&mut self, id: u8) -> Result<usize, BusError> {
        match self {
            Self::Dynamixel(bus) => {
                let (first, last) =
                    (dynamixel::table::REALTIME_TICK.address, dynamixel::table::PRESENT_TEMPERATURE.address);
                bus.client().count_answers(id, first, last - first + 1).await
            }
            // Position, speed, load, voltage, temperature.
            Self::Dynamixel1(bus) => bus.client().count_answers(id, 36, 8).await,
            Self::Feetech(bus) => bus.client().count_answers(id, 56, 8).await,
            Self::Blender(_) => Err(BusError::Unsupported),
        }
    }

    /// Lets the servo `from` go and gives it the id `to`, which it keeps without power. Whether it took it is for the caller to see: a
    /// servo may answer with either id or not at all.
    ///
    /// # Errors
    /// [`BusError`] where it cannot be let go or unlocked.
    pub async fn set_id(&mut self, from: u8, to: u8) -> Result<(), BusError> {
        let lock = self.lock();
        let taken = match self {
            Self::Dynamixel(bus) => {
                use dynamixel::table::{ID, TORQUE_ENABLE};
                // The table's EEPROM cannot be written while torque is on.
                bus.client().write(from, TORQUE_ENABLE.address, &[0]).await?;
                bus.client().write(from, ID.address, &[to]).await.map(drop)
            }
            Self::Dynamixel1(bus) => {
                bus.client().write(from, 24, &[0]).await?;
                bus.client().write(from, 3, &[to]).await.map(drop)
            }
            Self::Feetech(bus) => {
                let client = bus.client();
                client.write(from, 40, &[0]).await?;
                client.write(from, lock, &[0]).await?;
                let taken = client.write(from, 5, &[to]).await.map(drop);
                // Whichever id it has now is to be locked again.
                if client.write(to, lock, &[1]).await.is_err() {
                    client.write(from, lock, &[1]).await?;
                }
                taken
            }
            Self::Blender(_) => return Err(BusError::Unsupported),
        };
        match taken {
            Err(BusError::NoReply) => Ok(()),
            taken => taken,
        }
    }

    /// Where a Feetech servo's lock is: while it is 1, what is written to the EEPROM is forgotten without power.
    const fn lock(&self) -> u8 {
        match self {
            Self::Feetech(bus) if matches!(bus.series(), Series::Scs) => 48,
            _ => 55,
        }
    }

    /// Reads one servo; writes nothing to it.
    ///
    /// # Errors
    /// [`BusError`].
    pub async fn look(&mut self, id: u8) -> Result<Reading, BusError> {
        if let Self::Dynamixel(bus) = self {
            return look_at_dynamixel(bus, id).await;
        }
        let mut readings = [None];
        self.read_all(&[id], &mut readings).await?;
        let [reading] = readings;
        reading.ok_or(BusError::NoReply)
    }
}

/// Whether a ping's error byte is one of a servo: on a line that hears itself the ping comes back, with the number of the
/// instruction in its place.
const fn is_answer(error: u8) -> bool {
    error != protocol1::packet::Instruction::Ping as u8
}

/// As [`SerialBus::look`], without the indirect addresses that a player sets up.
async fn look_at_dynamixel<S: Read + Write, T: DelayNs>(
    bus: &mut DynamixelBus<S, Automatic, T>,
    id: u8,
) -> Result<Reading, BusError> {
    use dynamixel::table::*;
    const START: Register = TORQUE_ENABLE;
    const LEN: usize = (PRESENT_TEMPERATURE.address - START.address) as usize + 1;
    let mut data = [0; LEN];
    bus.client().read(id, START.address, &mut data).await?;
    let value = |register: Register| {
        let at = usize::from(register.address - START.address);
        let bytes = data.iter().skip(at).take(register.len.into()).rev();
        bytes.fold(0u32, |value, &byte| value << 8 | u32::from(byte))
    };
    Ok(Reading {
        position: value(PRESENT_POSITION) as i32,
        temperature: Some(value(PRESENT_TEMPERATURE) as u8),
        millivolts: Some(value(PRESENT_INPUT_VOLTAGE) as u16 * 100),
        load: Some(value(PRESENT_CURRENT) as i16),
        hardware_error: value(HARDWARE_ERROR_STATUS) as u8,
        torque: Some(value(TORQUE_ENABLE) != 0),
    })
}

impl_servo_bus!([S: Read + Write, T: DelayNs] SerialBus<S, T> { Dynamixel, Dynamixel1, Feetech, Blender });

/// Which port each of those buses of a puppet is on that are `wanted`: `PORT`, or `NAME=PORT,NAME=PORT` for several. Ports of others
/// may be named.
///
/// # Errors
/// A sentence where a bus has no port, or a name no bus.
pub fn paths(on: &str, names: &[String], wanted: impl Fn(usize) -> bool) -> Result<Vec<String>> {
    let chosen = names.iter().enumerate().filter(|(index, _)| wanted(*index)).map(|(_, name)| name.clone());
    let buses: &[String] = &chosen.collect::<Vec<_>>();
    if let ([_], false) = (buses, on.contains('=')) {
        return Ok(vec![on.to_owned()]);
    }
    let mut paths = vec![None; buses.len()];
    for part in on.split(',') {
        let expected = || buses.iter().map(|bus| format!("{bus}=PORT")).collect::<Vec<_>>().join(",");
        let Some((name, path)) = part.split_once('=') else {
            bail!("the puppet has {} buses, expected --on {}", buses.len(), expected());
        };
        match buses.iter().position(|bus| bus == name) {
            Some(index) => paths[index] = Some(path.to_owned()),
            None if names.iter().any(|bus| bus == name) => {}
            None => bail!("the puppet has no bus \"{name}\", expected --on {}", expected()),
        }
    }
    let missing = buses.iter().zip(&paths).find(|(_, path)| path.is_none());
    if let Some((bus, _)) = missing {
        bail!("--on says no port for the bus \"{bus}\"");
    }
    Ok(paths.into_iter().flatten().collect())
}

/// Opens all buses of a puppet, each at its path, in the order of the map.
///
/// # Errors
/// Those of [`SerialBus::open`].
pub fn open_each(map: &Map, paths: &[String]) -> Result<Vec<SerialBus>> {
    map.buses().iter().zip(paths).map(|(spec, path)| SerialBus::open(*spec, path)).collect()
}

/// As [`open_each`], as one bus.
///
/// # Errors
/// Those of [`SerialBus::open`].
pub fn open(map: &Map, paths: &[String]) -> Result<Buses> {
    join(map, open_each(map, paths)?)
}

/// The buses of a puppet as one.
///
/// # Errors
/// A sentence where there are more than a map has.
pub fn join(map: &Map, buses: Vec<SerialBus>) -> Result<Buses> {
    let mut joined = heapless::Vec::new();
    for (index, bus) in (0..).zip(buses) {
        if joined.push((bus, map.on_bus(index).len())).is_err() {
            bail!("a puppet has at most {MAX_BUSES} buses");
        }
    }
    Ok(JoinedBuses::new(joined))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_found_by_the_names_of_buses() {
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        let found =
            |on: &str, buses: &[&str]| paths(on, &names(buses), |_| true).map_err(|error| error.to_string());
        assert_eq!(found("/dev/ttyUSB0", &["bus"]), Ok(names(&["/dev/ttyUSB0"])));
        assert_eq!(found("face=b,arm=a", &["arm", "face"]), Ok(names(&["a", "b"])));
        let error = found("a", &["arm", "face"]).unwrap_err();
        assert_eq!(error, "the puppet has 2 buses, expected --on arm=PORT,face=PORT");
        assert_eq!(found("arm=a", &["arm", "face"]).unwrap_err(), "--on says no port for the bus \"face\"");
        assert!(found("leg=a", &["arm", "face"]).unwrap_err().contains("no bus \"leg\""));
        let only = paths("face=b,arm=a", &names(&["arm", "face"]), |index| index == 1).unwrap();
        assert_eq!(only, ["b"]);
    }

    #[test]
    fn pins_are_no_port() {
        let error = SerialBus::open(BusSpec { kind: BusKind::Pwm, baud: 50 }, "/dev/null").err().unwrap();
        assert!(error.to_string().contains("pwm"), "{error}");
    }
}
