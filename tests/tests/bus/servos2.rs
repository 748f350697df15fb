//! Servos of protocol 2.0, written from the e-Manual ("DYNAMIXEL Protocol 2.0", "XM430-W350") and from nothing else:
//! no line is shared with the client or with the virtual servos. They are strict: what the manual does not allow is
//! refused and noted.

use crate::wire::Servos;
use std::collections::BTreeMap;

/// CRC-16 of the manual, bit by bit: polynomial 0x8005, from 0.
pub fn crc(bytes: &[u8]) -> u16 {
    let mut register = 0_u16;
    for &byte in bytes {
        for bit in (0..8).rev() {
            let carry = register >> 15 & 1 != u16::from(byte >> bit & 1);
            register <<= 1;
            if carry {
                register ^= 0x8005;
            }
        }
    }
    register
}

/// A packet from its instruction and parameters, stuffed.
pub fn packet(id: u8, body: &[u8]) -> Vec<u8> {
    let mut stuffed: Vec<u8> = Vec::new();
    for &byte in body {
        stuffed.push(byte);
        if stuffed.ends_with(&[0xFF, 0xFF, 0xFD]) {
            stuffed.push(0xFD);
        }
    }
    let mut out = vec![0xFF, 0xFF, 0xFD, 0x00, id];
    out.extend((stuffed.len() as u16 + 2).to_le_bytes());
    out.extend(stuffed);
    let sum = crc(&out);
    out.extend(sum.to_le_bytes());
    out
}

pub fn unstuffed(body: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut at = 0;
    while at < body.len() {
        out.push(body[at]);
        if at >= 2 && body[at - 2..=at] == [0xFF, 0xFF, 0xFD] && body.get(at + 1) == Some(&0xFD) {
            at += 1;
        }
        at += 1;
    }
    out
}

/// Registers that may be written: address, bytes, least and greatest value.
const WRITABLE: [(u16, usize, i64, i64); 14] = [
    (7, 1, 0, 252),
    (9, 1, 0, 254),
    (11, 1, 0, 16),
    (64, 1, 0, 1),
    (65, 1, 0, 1),
    (68, 1, 0, 2),
    (98, 1, 0, 127),
    (100, 2, -885, 885),
    (102, 2, -1193, 1193),
    (104, 4, -1023, 1023),
    (108, 4, 0, 32767),
    (112, 4, 0, 32767),
    (116, 4, -1_048_575, 1_048_575),
    (120, 2, 0, 0),
];
const RAM: usize = 64;

pub struct Servo {
    pub id: u8,
    memory: [u8; 252],
    registered: Option<(u16, Vec<u8>)>,
    /// Silent until then, after power on.
    boots_until: u64,
    heard_at: u64,
    /// Every goal position that was taken.
    pub goals: Vec<i32>,
    /// Dead: hears and says nothing.
    pub dead: bool,
}

impl Servo {
    /// A servo at position 1000 · id + 500 with return delay 0, in extended position mode.
    pub fn new(id: u8) -> Self {
        let mut servo = Self {
            id,
            memory: [0; 252],
            registered: None,
            boots_until: 0,
            heard_at: 0,
            goals: Vec::new(),
            dead: false,
        };
        servo.put(0, &1020_u16.to_le_bytes());
        servo.put(6, &[46, id]);
        servo.put(11, &[4]);
        servo.put(132, &(1000 * i32::from(id) + 500).to_le_bytes());
        servo.start();
        servo
    }

    fn start(&mut self) {
        let position = self.word(132);
        self.memory[RAM..132].fill(0);
        self.put(68, &[2]);
        self.put(116, &position.to_le_bytes());
        self.put(126, &(-(i16::from(self.id % 100))).to_le_bytes());
        self.put(144, &121_u16.to_le_bytes());
        self.put(146, &[20 + self.id % 50]);
        for entry in 0..28_u16 {
            self.put(168 + 2 * entry, &(224 + entry).to_le_bytes());
        }
        self.memory[224..252].fill(0);
        self.registered = None;
    }

    fn put(&mut self, address: u16, bytes: &[u8]) {
        let at = usize::from(address);
        self.memory[at..at + bytes.len()].copy_from_slice(bytes);
    }

    fn word(&self, address: usize) -> i32 {
        i32::from_le_bytes(self.memory[address..address + 4].try_into().expect("four bytes"))
    }

    pub fn goal(&self) -> i32 {
        self.word(116)
    }

    pub fn torque(&self) -> bool {
        self.memory[64] == 1
    }

    pub fn watchdog(&self) -> i8 {
        self.memory[98] as i8
    }

    /// Where the servo stands.
    pub fn set_position(&mut self, position: i32) {
        self.put(132, &position.to_le_bytes());
        self.put(116, &position.to_le_bytes());
    }

    pub fn set_return_delay(&mut self, units: u8) {
        self.memory[9] = units;
    }

    /// Sets the hardware error status, which raises the alert.
    pub fn fail(&mut self, bits: u8) {
        self.memory[70] = bits;
    }

    /// Loses power for a moment.
    pub fn restart(&mut self, now: u64, micros: u64) {
        self.memory[70] = 0;
        self.start();
        self.boots_until = now + 1000 * micros;
    }

    fn alert(&self) -> u8 {
        if self.memory[70] == 0 { 0 } else { 0x80 }
    }

    fn return_delay(&self) -> u64 {
        2000 * u64::from(self.memory[9])
    }

    /// Where a byte lies: indirect data stand for others.
    fn place(&self, address: u16) -> Option<u16> {
        match address {
            0..=146 | 168..=223 => Some(address),
            224..=251 => {
                let entry = usize::from(168 + 2 * (address - 224));
                Some(u16::from_le_bytes([self.memory[entry], self.memory[entry + 1]])).filter(|&to| to < 252)
            }
            _ => None,
        }
    }

    fn read(&self, address: u16, len: u16) -> Result<Vec<u8>, u8> {
        (address..address.saturating_add(len))
            .map(|at| self.place(at).map(|at| self.memory[usize::from(at)]).ok_or(7))
            .collect()
    }

    fn write(&mut self, address: u16, bytes: &[u8]) -> Result<(), u8> {
        if bytes.is_empty() {
            return Err(5);
        }
        if (168..=223).contains(&address) {
            let end = usize::from(address) + bytes.len();
            if !address.is_multiple_of(2) || !bytes.len().is_multiple_of(2) || end > 224 {
                return Err(5);
            }
            self.put(address, bytes);
            return Ok(());
        }
        let &(_, len, least, greatest) = WRITABLE.iter().find(|(at, ..)| *at == address).ok_or(7_u8)?;
        if bytes.len() != len {
            return Err(5);
        }
        if usize::from(address) < RAM && self.torque() {
            return Err(7);
        }
        let mut word = [if bytes[len - 1] & 0x80 != 0 && least < 0 { 0xFF } else { 0 }; 8];
        word[..len].copy_from_slice(bytes);
        let value = i64::from_le_bytes(word);
        // A servo that its bus watchdog has stopped takes no goals.
        let stopped = self.watchdog() == -1 && (100..=119).contains(&address);
        if value < least || value > greatest || stopped {
            return Err(4);
        }
        if address == 64 && value == 1 && self.memory[70] != 0 {
            return Err(1);
        }
        self.put(address, bytes);
        if address == 116 {
            self.goals.push(value as i32);
        }
        if self.torque() {
            let goal = self.goal();
            self.put(132, &goal.to_le_bytes());
        }
        Ok(())
    }

    fn carry_out(&mut self, instruction: u8, parameters: &[u8], now: u64) -> Result<Vec<u8>, u8> {
        let address = |p: &[u8]| u16::from_le_bytes([p[0], p[1]]);
        match (instruction, parameters) {
            (0x01, []) => Ok(vec![self.memory[0], self.memory[1], self.memory[6]]),
            (0x02, [_, _, l0, l1]) => self.read(address(parameters), u16::from_le_bytes([*l0, *l1])),
            (0x03, [_, _, bytes @ ..]) => self.write(address(parameters), bytes).map(|()| vec![]),
            (0x04, [_, _, bytes @ ..]) => {
                self.registered = Some((address(parameters), bytes.to_vec()));
                self.memory[69] = 1;
                Ok(vec![])
            }
            (0x05, []) => {
                let (address, bytes) = self.registered.take().ok_or(2_u8)?;
                self.memory[69] = 0;
                self.write(address, &bytes).map(|()| vec![])
            }
            (0x06, [0xFF | 0x01 | 0x02]) => {
                self.start();
                Ok(vec![])
            }
            (0x08, []) => {
                self.restart(now, 30_000);
                Ok(vec![])
            }
            (0x10, [0x01, 0x44, 0x58, 0x4C, 0x22]) if !self.torque() => {
                let position = self.word(132).rem_euclid(4096);
                self.put(132, &position.to_le_bytes());
                Ok(vec![])
            }
            (0x10, _) => Err(1),
            (0x01..=0x08, _) => Err(5),
            _ => Err(2),
        }
    }

    fn status(&self, result: Result<Vec<u8>, u8>) -> Vec<u8> {
        let mut body = vec![0x55, self.alert() | result.as_ref().err().copied().unwrap_or(0)];
        body.extend(result.unwrap_or_default());
        packet(self.id, &body)
    }
}

/// Servos on a wire.
pub struct XSeries {
    pub servos: Vec<Servo>,
    pending: Vec<u8>,
    heard_at: u64,
    /// What the manual does not allow.
    pub complaints: Vec<String>,
    /// How often each instruction was carried out.
    pub seen: BTreeMap<u8, usize>,
}

impl XSeries {
    pub fn new(ids: &[u8]) -> Self {
        let servos = ids.iter().map(|&id| Servo::new(id)).collect();
        Self { servos, pending: Vec::new(), heard_at: 0, complaints: Vec::new(), seen: BTreeMap::new() }
    }

    pub fn servo(&mut self, id: u8) -> &mut Servo {
        self.servos.iter_mut().find(|servo| servo.id == id).expect("a servo of this bus")
    }

    /// The next whole packet of what was heard: id, instruction and parameters, stuffing removed.
    fn next(&mut self) -> Option<(u8, Vec<u8>)> {
        loop {
            let header = self.pending.windows(4).position(|window| window == [0xFF, 0xFF, 0xFD, 0x00]);
            let Some(header) = header else {
                let keep = self.pending.len().saturating_sub(3);
                self.pending.drain(..keep);
                return None;
            };
            self.pending.drain(..header);
            let [_, _, _, _, id, l0, l1, ..] = self.pending[..] else { return None };
            let len = 7 + usize::from(u16::from_le_bytes([l0, l1]));
            if !(10..=1024).contains(&len) {
                self.complaints.push(format!("a length of {}", len - 7));
                self.pending.drain(..4);
                continue;
            }
            let bytes = self.pending.get(..len)?.to_vec();
            if crc(&bytes[..len - 2]).to_le_bytes() != bytes[len - 2..] {
                self.complaints.push("a wrong checksum".to_owned());
                self.pending.drain(..4);
                continue;
            }
            self.pending.drain(..len);
            return Some((id, unstuffed(&bytes[7..len - 2])));
        }
    }

    fn obey(&mut self, id: u8, body: &[u8], now: u64) -> Vec<(u64, Vec<u8>)> {
        let (&instruction, parameters) = body.split_first().expect("a packet has an instruction");
        let Self { servos, complaints, .. } = self;
        if instruction == 0x55 {
            return vec![];
        }
        *self.seen.entry(instruction).or_default() += 1;
        let mut awake: Vec<&mut Servo> =
            servos.iter_mut().filter(|servo| !servo.dead && servo.boots_until <= now).collect();
        for servo in &mut awake {
            let limit = 20_000_000 * u64::try_from(servo.watchdog()).unwrap_or(0);
            if limit > 0 && now.saturating_sub(servo.heard_at) > limit {
                servo.memory[98] = 0xFF;
            }
            servo.heard_at = now;
        }
        match instruction {
            0x82 | 0x8A | 0x92 | 0x9A => {
                let Some(list) = read_list(instruction, parameters).filter(|_| id == 254) else {
                    complaints.push(format!("a malformed instruction {instruction:#x}"));
                    return vec![];
                };
                let asked = list.iter().map(|&(id, address, len)| {
                    let servo = awake.iter().find(|servo| servo.id == id);
                    servo.map(|servo| (&**servo, servo.read(address, len), len))
                });
                if instruction & 0x08 != 0 {
                    return joint(asked.collect(), &list);
                }
                // A servo waits for the one before it in the list, so one that is missing silences the rest.
                let answers = asked.map_while(|asked| asked);
                answers.map(|(servo, data, _)| (servo.return_delay(), servo.status(data))).collect()
            }
            0x83 | 0x93 => {
                let Some(list) = write_list(instruction, parameters).filter(|_| id == 254) else {
                    complaints.push(format!("a malformed instruction {instruction:#x}"));
                    return vec![];
                };
                for (id, address, bytes) in list {
                    for servo in awake.iter_mut().filter(|servo| servo.id == id) {
                        if let Err(error) = servo.write(address, bytes) {
                            complaints.push(format!("servo {id} refused {address} with {error}"));
                        }
                    }
                }
                vec![]
            }
            _ => {
                let mut answers = Vec::new();
                for servo in awake.iter_mut().filter(|servo| id == 254 || id == servo.id) {
                    let alert = servo.alert();
                    let result = servo.carry_out(instruction, parameters, now);
                    if let Err(error) = result {
                        complaints.push(format!("servo {} refused {instruction:#x} with {error}", servo.id));
                    }
                    let answers_to = match servo.memory[68] {
                        0 => instruction == 0x01,
                        1 => instruction <= 0x02,
                        _ => true,
                    };
                    if answers_to && (id != 254 || instruction == 0x01) {
                        let mut status = servo.status(result);
                        // The answer to a reboot is from before it.
                        status[8] |= alert;
                        seal(&mut status);
                        answers.push((servo.return_delay(), status));
                    }
                }
                answers
            }
        }
    }
}

/// (id, address, length) of each servo asked.
fn read_list(instruction: u8, parameters: &[u8]) -> Option<Vec<(u8, u16, u16)>> {
    let word = |low: u8, high: u8| u16::from_le_bytes([low, high]);
    let list: Vec<_> = match (instruction & 0xF7, parameters) {
        (0x82, [a0, a1, l0, l1, ids @ ..]) => {
            ids.iter().map(|&id| (id, word(*a0, *a1), word(*l0, *l1))).collect()
        }
        (0x92, items) if items.len() % 5 == 0 => {
            items.chunks(5).map(|item| (item[0], word(item[1], item[2]), word(item[3], item[4]))).collect()
        }
        _ => return None,
    };
    let mut ids: Vec<u8> = list.iter().map(|item| item.0).collect();
    ids.sort_unstable();
    ids.dedup();
    (ids.len() == list.len() && !list.is_empty()).then_some(list)
}

fn write_list(instruction: u8, parameters: &[u8]) -> Option<Vec<(u8, u16, &[u8])>> {
    let mut list = Vec::new();
    if instruction == 0x83 {
        let (&[a0, a1, l0, l1], rest) = parameters.split_first_chunk()?;
        let len = usize::from(u16::from_le_bytes([l0, l1]));
        let items = rest.chunks_exact(1 + len);
        items.remainder().is_empty().then_some(())?;
        list.extend(items.map(|item| (item[0], u16::from_le_bytes([a0, a1]), &item[1..])));
    } else {
        let mut rest = parameters;
        while let Some((&[id, a0, a1, l0, l1], data)) = rest.split_first_chunk() {
            let (bytes, later) = data.split_at_checked(usize::from(u16::from_le_bytes([l0, l1])))?;
            list.push((id, u16::from_le_bytes([a0, a1]), bytes));
            rest = later;
        }
        rest.is_empty().then_some(())?;
    }
    Some(list)
}

type Asked<'s> = Option<(&'s Servo, Result<Vec<u8>, u8>, u16)>;

/// The joint answer of a fast read, up to the first servo that is missing.
fn joint(asked: Vec<Asked<'_>>, list: &[(u8, u16, u16)]) -> Vec<(u64, Vec<u8>)> {
    let length = 1 + list.iter().map(|item| item.2 + 4).sum::<u16>();
    let mut out = vec![0xFF, 0xFF, 0xFD, 0x00, 0xFE];
    out.extend(length.to_le_bytes());
    out.push(0x55);
    let mut delay = None;
    for (servo, data, len) in asked.into_iter().map_while(|asked| asked) {
        delay.get_or_insert(servo.return_delay());
        out.push(servo.alert() | data.as_ref().err().copied().unwrap_or(0));
        out.push(servo.id);
        out.extend(data.unwrap_or_else(|_| vec![0; len.into()]));
        let sum = crc(&out);
        out.extend(sum.to_le_bytes());
    }
    delay.map(|delay| (delay, out)).into_iter().collect()
}

/// Makes length and checksum, of a joint answer all checksums, right again.
pub fn seal(packet: &mut [u8]) {
    let len = packet.len();
    if len < 10 {
        return;
    }
    let length = (len as u16 - 7).to_le_bytes();
    packet[5..7].copy_from_slice(&length);
    let sum = crc(&packet[..len - 2]);
    packet[len - 2..].copy_from_slice(&sum.to_le_bytes());
}

impl Servos for XSeries {
    fn hear(&mut self, bytes: &[u8], now: u64) -> Vec<(u64, Vec<u8>)> {
        if now.saturating_sub(self.heard_at) > 1_500_000 {
            self.pending.clear();
        }
        self.heard_at = now;
        self.pending.extend(bytes);
        let mut answers = Vec::new();
        while let Some((id, body)) = self.next() {
            answers.extend(self.obey(id, &body, now));
        }
        answers
    }

    fn seal(&self, packet: &mut [u8]) {
        seal(packet);
    }

    fn places(&self) -> (usize, usize) {
        (4, 5)
    }

    fn refuse(&self, bytes: &[u8], number: u8) -> Vec<u8> {
        if bytes[4] != 0xFE {
            return packet(bytes[4], &[0x55, number]);
        }
        // In a joint answer the first part refuses.
        let mut joint = bytes.to_vec();
        joint[8] = number;
        let len = joint.len();
        let parts = self.servos.iter().filter(|servo| !servo.dead).count();
        let part = (len - 8) / parts.max(1);
        for end in (8 + part..=len).step_by(part.max(1)) {
            let sum = crc(&joint[..end - 2]);
            joint[end - 2..end].copy_from_slice(&sum.to_le_bytes());
        }
        joint
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_servos_speak_as_the_manual() {
        // "Read", "Sync Write" and "Ping" of the page "DYNAMIXEL Protocol 2.0".
        assert_eq!(packet(1, &[2, 0x84, 0, 4, 0])[12..], [0x1D, 0x15]);
        assert_eq!(packet(1, &[0x55, 0, 6, 4, 0x26])[12..], [0x65, 0x5D]);
        let mut servos = XSeries::new(&[1]);
        let answers = servos.hear(&[0xFF, 0xFF, 0xFD, 0, 1, 3, 0, 1, 0x19, 0x4E], 0);
        assert_eq!(answers, [(0, packet(1, &[0x55, 0, 0xFC, 3, 46]))]);
    }
}
