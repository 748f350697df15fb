//! Setting servos right.

use super::judge::Mismatch;
use super::survey::Found;
use super::table::{Register, Role, eeprom_end, registers};
use crate::ports::{SerialBus, TRIES};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};
use firmware::map::BusKind;
use serde::Serialize;
use servo_wire::bus::BusError;

/// What came of setting a register.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fixed {
    /// The sentence about it.
    pub sentence: String,
    /// Whether it is set now.
    pub done: bool,
}

/// Sets what is amiss of a servo, and reads each register back. What is kept without power is written only while the servo does not
/// hold; `let_go`: one that holds is let go for it.
///
/// # Errors
/// [`BusError::Port`].
pub async fn fix<S: Read + Write, T: DelayNs>(
    bus: &mut SerialBus<S, T>,
    kind: BusKind,
    found: &Found,
    let_go: bool,
) -> Result<Vec<Fixed>, BusError> {
    let mut fixer = Fixer { bus, kind, id: found.expected.id };
    let named = found.named();
    // A servo that answers nothing to writes is made to answer first.
    let mut wanted: Vec<&Mismatch> =
        found.mismatches.iter().filter(|mismatch| mismatch.fix.is_some()).collect();
    let level = fixer.register(Role::ReturnLevel).map(|register| register.address);
    wanted.sort_by_key(|mismatch| mismatch.address != level);
    let mut all = Vec::new();
    for mismatch in wanted {
        let (Some(value), Some(address)) = (mismatch.fix, mismatch.address) else { continue };
        let Some(register) = registers(kind).iter().find(|register| register.address == address) else {
            continue;
        };
        let what = format!("{named}: {} ({address})", register.name);
        let kept = address < eeprom_end(kind);
        if kept {
            match fixer.value(Role::Torque).await {
                Err(BusError::Port) => return Err(BusError::Port),
                Ok(0) => {}
                Ok(_) if let_go => {
                    fixer.write(Role::Torque, 0).await?;
                }
                Ok(_) => {
                    let sentence = format!(
                        "{what} stays {}: it is written only while torque is off, and the servo holds; add --torque-off to let it go",
                        mismatch.found
                    );
                    all.push(Fixed { sentence, done: false });
                    continue;
                }
                // One that answers no reads is made to.
                Err(_) if Some(address) == level => {}
                Err(error) => {
                    all.push(Fixed {
                        sentence: format!("{what} stays {}: {error}", mismatch.found),
                        done: false,
                    });
                    continue;
                }
            }
        }
        let unlocks = kept && matches!(kind, BusKind::Sts | BusKind::Scs);
        if unlocks {
            fixer.write(Role::Lock, 0).await?;
        }
        fixer.write_register(register, value).await?;
        if unlocks {
            fixer.write(Role::Lock, 1).await?;
        }
        let sentence = match fixer.read(register).await {
            Ok(now) if now == value => {
                all.push(Fixed {
                    sentence: format!("{what} was {}, and is {now} now", mismatch.found),
                    done: true,
                });
                continue;
            }
            Ok(now) => format!("{what} was {}, did not take {value}, and is {now}", mismatch.found),
            Err(error) => format!(
                "{what} was {}, was sent {value}, and could not be read back: {error}",
                mismatch.found
            ),
        };
        all.push(Fixed { sentence, done: false });
    }
    Ok(all)
}

struct Fixer<'b, S, T> {
    bus: &'b mut SerialBus<S, T>,
    kind: BusKind,
    id: u8,
}

impl<S: Read + Write, T: DelayNs> Fixer<'_, S, T> {
    fn register(&self, role: Role) -> Option<&'static Register> {
        registers(self.kind).iter().find(|register| register.role == role)
    }

    async fn value(&mut self, role: Role) -> Result<i64, BusError> {
        match self.register(role) {
            Some(register) => self.read(register).await,
            None => Err(BusError::Unsupported),
        }
    }

    async fn write(&mut self, role: Role, value: i64) -> Result<(), BusError> {
        match self.register(role) {
            Some(register) => self.write_register(register, value).await,
            None => Ok(()),
        }
    }

    async fn read(&mut self, register: &Register) -> Result<i64, BusError> {
        let mut bytes = vec![0; usize::from(register.len)];
        let mut done = Err(BusError::NoReply);
        for _ in 0..TRIES {
            done = self.bus.read_registers(self.id, register.address, &mut bytes).await;
            if done.is_ok() {
                break;
            }
        }
        done.map(|()| register.value(self.kind, &bytes))
    }

    /// Writes; whether the servo took it is seen when it is read back.
    async fn write_register(&mut self, register: &Register, value: i64) -> Result<(), BusError> {
        let bytes = register.bytes(self.kind, value);
        match self.bus.write_registers(self.id, register.address, &bytes).await {
            Err(BusError::Port) => Err(BusError::Port),
            _ => Ok(()),
        }
    }
}
