//! Semihosting (Arm, "Semihosting for AArch32 and AArch64", 2.0): what images use to write, to read and to end.
//!
//! Nothing here touches the host's files: those that an image opens are in [`Files`].

use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::fault::Cause;
use crate::trap::Trap;
use std::collections::BTreeMap;

/// Files of the image: what the host gave, and what the image has written.
pub type Files = BTreeMap<String, Vec<u8>>;

/// "Out of nothing".
const FAILED: u32 = u32::MAX;

/// Reasons of SYS_EXIT: the one that means success.
const APPLICATION_EXIT: u32 = 0x2_0026;

/// An open file.
#[derive(Clone, Debug)]
enum Handle {
    Console,
    File { name: String, at: usize },
}

/// What an image has said and is told by semihosting.
///
/// The operations are SYS_OPEN, CLOSE, WRITEC, WRITE0, WRITE, READ, READC, ISTTY, SEEK, FLEN, CLOCK, TIME, ERRNO,
/// GET_CMDLINE, EXIT and EXIT_EXTENDED. Others stop the run with [`Cause::Semihosting`].
#[derive(Clone, Debug, Default)]
pub struct Semihosting {
    /// What the image has written to the console, until somebody takes it.
    pub console: Vec<u8>,
    /// The files that the image sees.
    pub files: Files,
    /// What the image gets as its command line.
    pub command_line: String,
    handles: Vec<Option<Handle>>,
}

impl Semihosting {
    /// Carries out the operation in r0 on the block at r1. Gives the exit code where that ends the image.
    pub(crate) fn operate(&mut self, cpu: &mut Cpu, bus: &mut Bus) -> Result<Option<u32>, Trap> {
        let (operation, block) = (cpu.r[0], cpu.r[1]);
        let result = match operation {
            0x01 => {
                let [name, mode, len] = words(cpu, bus, block)?;
                let name = String::from_utf8_lossy(&bytes(cpu, bus, name, len)?).into_owned();
                self.open(name, mode)
            }
            0x02 => {
                let [number] = words(cpu, bus, block)?;
                match self.handles.get_mut(number.wrapping_sub(1) as usize) {
                    Some(handle) => {
                        *handle = None;
                        0
                    }
                    None => FAILED,
                }
            }
            0x03 => {
                let byte = cpu.load::<1>(bus, block, false)? as u8;
                self.console.push(byte);
                return Ok(None);
            }
            0x04 => {
                let mut address = block;
                loop {
                    let byte = cpu.load::<1>(bus, address, false)? as u8;
                    if byte == 0 {
                        break;
                    }
                    self.console.push(byte);
                    address = address.wrapping_add(1);
                }
                return Ok(None);
            }
            0x05 => {
                let [number, address, len] = words(cpu, bus, block)?;
                self.write_file(cpu, bus, number, address, len)?
            }
            0x06 => {
                let [number, address, len] = words(cpu, bus, block)?;
                self.read_file(cpu, bus, number, address, len)?
            }
            // SYS_READC: nobody types.
            0x07 => FAILED,
            0x09 => {
                let [number] = words(cpu, bus, block)?;
                match self.open_file(number) {
                    Some(Handle::Console) => 1,
                    Some(Handle::File { .. }) => 0,
                    None => FAILED,
                }
            }
            0x0a => {
                let [number, to] = words(cpu, bus, block)?;
                self.seek(number, to)
            }
            0x0c => {
                let [number] = words(cpu, bus, block)?;
                match self.open_file(number) {
                    Some(Handle::File { name, .. }) => {
                        self.files.get(&name).map_or(FAILED, |bytes| bytes.len() as u32)
                    }
                    Some(Handle::Console) => 0,
                    None => FAILED,
                }
            }
            // SYS_CLOCK, hundredths of a second; there is no clock but the core's.
            0x10 => (bus.clock.now / 1_000_000) as u32,
            // SYS_TIME: runs must be alike.
            0x11 => 0,
            // SYS_ERRNO.
            0x13 => 0,
            0x15 => self.give_command_line(cpu, bus, block)?,
            0x18 => {
                let code = if block == APPLICATION_EXIT { 0 } else { 1 };
                return Ok(Some(code));
            }
            0x20 => {
                let [reason, code] = words(cpu, bus, block)?;
                let code = if reason == APPLICATION_EXIT { code } else { 1 };
                return Ok(Some(code));
            }
            _ => return Err(Trap::Fault(Cause::Semihosting { operation })),
        };
        cpu.r[0] = result;
        Ok(None)
    }

    fn open_file(&self, number: u32) -> Option<Handle> {
        self.handles.get(number.wrapping_sub(1) as usize)?.clone()
    }

    /// Opens the console `:tt` or a file; from mode 4 on they are written to, from 4 to 7 from the beginning.
    fn open(&mut self, name: String, mode: u32) -> u32 {
        let handle = if name == ":tt" {
            Handle::Console
        } else {
            let at = match mode {
                0..=3 if !self.files.contains_key(&name) => return FAILED,
                0..=3 => 0,
                4..=7 => {
                    self.files.insert(name.clone(), Vec::new());
                    0
                }
                _ => self.files.entry(name.clone()).or_default().len(),
            };
            Handle::File { name, at }
        };
        // The lowest number that is free, as in QEMU.
        let place = self.handles.iter().position(Option::is_none).unwrap_or(self.handles.len());
        if place == self.handles.len() {
            self.handles.push(None);
        }
        if let Some(free) = self.handles.get_mut(place) {
            *free = Some(handle);
        }
        place as u32 + 1
    }

    /// SYS_WRITE: gives the number of bytes that were not written.
    fn write_file(
        &mut self,
        cpu: &Cpu,
        bus: &mut Bus,
        number: u32,
        address: u32,
        len: u32,
    ) -> Result<u32, Trap> {
        let bytes = bytes(cpu, bus, address, len)?;
        match self.handles.get_mut(number.wrapping_sub(1) as usize) {
            Some(Some(Handle::Console)) => self.console.extend_from_slice(&bytes),
            Some(Some(Handle::File { name, at })) => {
                let file = self.files.entry(name.clone()).or_default();
                let end = *at + bytes.len();
                if file.len() < end {
                    file.resize(end, 0);
                }
                file.splice(*at..end, bytes);
                *at = end;
            }
            _ => return Ok(len),
        }
        Ok(0)
    }

    /// SYS_READ: gives the number of bytes that were not read.
    fn read_file(
        &mut self,
        cpu: &Cpu,
        bus: &mut Bus,
        number: u32,
        address: u32,
        len: u32,
    ) -> Result<u32, Trap> {
        let bytes = match self.handles.get_mut(number.wrapping_sub(1) as usize) {
            Some(Some(Handle::File { name, at })) => {
                let file = self.files.get(name).map_or(&[][..], Vec::as_slice);
                let rest = file.get(*at..).unwrap_or_default();
                let bytes = rest.get(..len as usize).unwrap_or(rest).to_vec();
                *at += bytes.len();
                bytes
            }
            _ => Vec::new(),
        };
        for (to, byte) in (0..).zip(&bytes) {
            cpu.store::<1>(bus, address.wrapping_add(to), u32::from(*byte), false)?;
        }
        Ok(len - bytes.len() as u32)
    }

    fn seek(&mut self, number: u32, to: u32) -> u32 {
        match self.handles.get_mut(number.wrapping_sub(1) as usize) {
            Some(Some(Handle::File { at, .. })) => {
                *at = to as usize;
                0
            }
            _ => FAILED,
        }
    }

    /// SYS_GET_CMDLINE: the text with a zero after it, and its length into the block.
    fn give_command_line(&self, cpu: &Cpu, bus: &mut Bus, block: u32) -> Result<u32, Trap> {
        let [buffer, size] = words(cpu, bus, block)?;
        let text = self.command_line.clone();
        if text.len() as u32 >= size {
            return Ok(FAILED);
        }
        for (at, byte) in (0..).zip(text.bytes().chain([0])) {
            cpu.store::<1>(bus, buffer.wrapping_add(at), u32::from(byte), false)?;
        }
        cpu.store::<4>(bus, block.wrapping_add(4), text.len() as u32, true)?;
        Ok(0)
    }
}

/// The first words of the parameter block.
fn words<const N: usize>(cpu: &Cpu, bus: &mut Bus, block: u32) -> Result<[u32; N], Trap> {
    let mut words = [0; N];
    for (address, word) in (block..).step_by(4).zip(&mut words) {
        *word = cpu.load::<4>(bus, address, true)?;
    }
    Ok(words)
}

fn bytes(cpu: &Cpu, bus: &mut Bus, address: u32, len: u32) -> Result<Vec<u8>, Trap> {
    (0..len).map(|at| Ok(cpu.load::<1>(bus, address.wrapping_add(at), false)? as u8)).collect()
}
