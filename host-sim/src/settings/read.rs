//! Reading the settings of a servo.

use super::table::{Register, Role, blocks, registers};
use crate::ports::{Identity, SerialBus, TRIES};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};
use firmware::map::BusKind;
use servo_wire::bus::BusError;

/// What a servo is set to.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// What it speaks.
    pub kind: BusKind,
    /// Who it says it is.
    pub identity: Identity,
    /// The values of [`registers`], in their order.
    values: Vec<i64>,
}

impl Settings {
    /// The value of the register with this role, where such a servo has one.
    #[must_use]
    pub fn get(&self, role: Role) -> Option<i64> {
        self.each().find(|(register, _)| register.role == role).map(|(_, value)| value)
    }

    /// All registers with their values.
    pub fn each(&self) -> impl Iterator<Item = (&'static Register, i64)> {
        registers(self.kind).iter().zip(self.values.iter().copied())
    }

    /// Settings for tests and for servos that are not there: all 0, but for these.
    #[cfg(test)]
    pub fn of(kind: BusKind, model: u16, given: &[(Role, i64)]) -> Self {
        let value = |register: &Register| {
            given.iter().find(|(role, _)| *role == register.role).map_or(0, |(_, value)| *value)
        };
        let identity = Identity { model, firmware: 46 };
        Self { kind, identity, values: registers(kind).iter().map(value).collect() }
    }
}

/// Reads a servo's settings; writes nothing to it.
///
/// # Errors
/// [`BusError::NoReply`] where it says nothing at all; [`BusError::Unsupported`] where it says that it is there and answers
/// no read, which is its Status Return Level.
pub async fn read<S: Read + Write, T: DelayNs>(
    bus: &mut SerialBus<S, T>,
    kind: BusKind,
    id: u8,
) -> Result<Settings, BusError> {
    let mut identity = Err(BusError::NoReply);
    for _ in 0..TRIES {
        identity = bus.identify(id).await;
        if identity.is_ok() {
            break;
        }
    }
    let identity = match identity {
        Ok(identity) => identity,
        // Those of protocol 1.0 say who they are to a read, and that they are there to a ping.
        Err(BusError::NoReply) if bus.is_there(id).await => return Err(BusError::Unsupported),
        Err(error) => return Err(error),
    };
    let mut memory = Vec::new();
    for &(start, len) in blocks(kind) {
        let mut block = vec![0; usize::from(len)];
        let mut done = Err(BusError::NoReply);
        for _ in 0..TRIES {
            done = bus.read_registers(id, start, &mut block).await;
            if done.is_ok() {
                break;
            }
        }
        match done {
            Ok(()) => memory.extend(block),
            Err(BusError::NoReply) if memory.is_empty() => return Err(BusError::Unsupported),
            Err(error) => return Err(error),
        }
    }
    let value = |register: &Register| {
        let at = usize::from(register.address);
        memory.get(at..at + usize::from(register.len)).map_or(0, |bytes| register.value(kind, bytes))
    };
    Ok(Settings { kind, identity, values: registers(kind).iter().map(value).collect() })
}
