//! Servos of protocol 1.0 and of Feetech, written from the manuals ("DYNAMIXEL Protocol 1.0", "AX-12A"; Feetech's memory
//! tables) and from nothing else: no line is shared with the clients. They are strict.

use crate::wire::Servos;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Ax,
    Sts,
    Scs,
}

/// A packet from its id and what length counts, without the checksum.
pub fn packet(id: u8, body: &[u8]) -> Vec<u8> {
    let mut out = vec![0xFF, 0xFF, id, body.len() as u8 + 1];
    out.extend(body);
    out.push(0);
    seal(&mut out);
    out
}

fn seal(packet: &mut [u8]) {
    let len = packet.len();
    if len < 6 {
        return;
    }
    packet[3] = (len - 4) as u8;
    packet[len - 1] = 255 - sum(&packet[2..len - 1]) as u8;
}

/// The sum of all bytes from the id on, without its carry; 255 with the checksum.
pub fn sum(bytes: &[u8]) -> u32 {
    bytes.iter().map(|&byte| u32::from(byte)).sum::<u32>() % 256
}

pub struct Servo {
    pub id: u8,
    kind: Kind,
    memory: [u8; 80],
    boots_until: u64,
    pub goals: Vec<i32>,
    pub dead: bool,
    /// Error bits of its answers.
    pub state: u8,
}

/// Addresses: identity, torque, goal, present position.
struct Table {
    id: usize,
    torque: usize,
    goal: usize,
    present: usize,
}

impl Kind {
    fn table(self) -> Table {
        match self {
            Self::Ax => Table { id: 3, torque: 24, goal: 30, present: 36 },
            Self::Sts | Self::Scs => Table { id: 5, torque: 40, goal: 42, present: 56 },
        }
    }

    fn bytes(self, value: u16) -> [u8; 2] {
        if self == Self::Scs { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    fn value(self, bytes: [u8; 2]) -> u16 {
        if self == Self::Scs { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) }
    }

    /// Registers that may be written: address and bytes.
    fn writable(self) -> &'static [(usize, usize)] {
        match self {
            Self::Ax => &[(3, 1), (24, 1), (25, 1), (30, 2), (32, 2), (34, 2)],
            Self::Sts => &[(5, 1), (40, 1), (41, 1), (42, 2), (44, 2), (46, 2), (55, 1)],
            Self::Scs => &[(5, 1), (40, 1), (42, 2), (44, 2), (46, 2), (48, 1)],
        }
    }
}

impl Servo {
    /// A servo whose present position is `position`.
    fn new(id: u8, kind: Kind, position: u16) -> Self {
        let mut memory = [0; 80];
        let table = kind.table();
        memory[table.id] = id;
        memory[table.present..table.present + 2].copy_from_slice(&kind.bytes(position));
        // Load 0.1 % · id with the sign bit, 12.1 V, 20 degrees and more.
        let load = kind.bytes(0x400 | u16::from(id));
        memory[table.present + 4..table.present + 6].copy_from_slice(&load);
        memory[table.present + 6] = 121;
        memory[table.present + 7] = 20 + id % 50;
        Self { id, kind, memory, boots_until: 0, goals: Vec::new(), dead: false, state: 0 }
    }

    pub fn torque(&self) -> bool {
        self.memory[self.kind.table().torque] == 1
    }

    pub fn goal(&self) -> i32 {
        let at = self.kind.table().goal;
        self.kind.value([self.memory[at], self.memory[at + 1]]).into()
    }

    pub fn restart(&mut self, now: u64, micros: u64) {
        let table = self.kind.table();
        self.memory[table.torque] = 0;
        self.boots_until = now + 1000 * micros;
    }

    /// The error bit, where the servo does not obey.
    fn write(&mut self, address: usize, bytes: &[u8]) -> Result<(), u8> {
        let range = if self.kind == Kind::Ax { 1 << 3 } else { 0 };
        let &(_, len) = self.kind.writable().iter().find(|(at, _)| *at == address).ok_or(range)?;
        if bytes.len() != len {
            return Err(range);
        }
        let table = self.kind.table();
        if address == table.goal {
            let goal = self.kind.value([bytes[0], bytes[1]]);
            if self.kind != Kind::Sts && goal > 1023 {
                return Err(if self.kind == Kind::Ax { 1 << 1 } else { 0 });
            }
            self.goals.push(goal.into());
        }
        self.memory[address..address + len].copy_from_slice(bytes);
        if self.torque() {
            let goal = [self.memory[table.goal], self.memory[table.goal + 1]];
            self.memory[table.present..table.present + 2].copy_from_slice(&goal);
        }
        Ok(())
    }

    fn carry_out(&mut self, code: u8, parameters: &[u8], now: u64) -> Option<Result<Vec<u8>, u8>> {
        Some(match (code, parameters) {
            (1, []) => Ok(vec![]),
            (2, &[address, len]) => {
                let from = usize::from(address);
                let read = self.memory.get(from..from + usize::from(len));
                read.filter(|read| !read.is_empty()).map(<[u8]>::to_vec).ok_or(1 << 3)
            }
            (3, [address, bytes @ ..]) => self.write(usize::from(*address), bytes).map(|()| vec![]),
            (8, []) if self.kind != Kind::Ax => {
                self.restart(now, 30_000);
                return None;
            }
            _ => Err(1 << 6),
        })
    }
}

/// Servos on a wire.
pub struct Protocol1 {
    pub servos: Vec<Servo>,
    kind: Kind,
    pending: Vec<u8>,
    heard_at: u64,
    pub complaints: Vec<String>,
}

impl Protocol1 {
    /// Servos of these ids and present positions.
    pub fn new(kind: Kind, servos: &[(u8, u16)]) -> Self {
        let servos = servos.iter().map(|&(id, position)| Servo::new(id, kind, position)).collect();
        Self { servos, kind, pending: Vec::new(), heard_at: 0, complaints: Vec::new() }
    }

    fn next(&mut self) -> Option<(u8, Vec<u8>)> {
        loop {
            match self.pending[..] {
                [] | [0xFF] | [0xFF, 0xFF] => return None,
                [0xFF, 0xFF, 0xFF, ..] => {}
                [0xFF, 0xFF, _] => return None,
                [0xFF, 0xFF, id, length @ 2..=255, ..] => {
                    let len = 4 + usize::from(length);
                    let bytes = self.pending.get(..len)?.to_vec();
                    if sum(&bytes[2..]) == 255 {
                        self.pending.drain(..len);
                        return Some((id, bytes[4..len - 1].to_vec()));
                    }
                    self.complaints.push("a wrong checksum".to_owned());
                }
                _ => {}
            }
            self.pending.remove(0);
        }
    }

    fn obey(&mut self, id: u8, body: &[u8], now: u64) -> Vec<(u64, Vec<u8>)> {
        let (&code, parameters) = body.split_first().expect("a packet has an instruction");
        let Self { servos, complaints, kind, .. } = self;
        let mut awake: Vec<&mut Servo> =
            servos.iter_mut().filter(|servo| !servo.dead && servo.boots_until <= now).collect();
        let mut answers = Vec::new();
        match (code, parameters) {
            (0x83, [address, len, list @ ..])
                if id == 254 && !list.is_empty() && list.len() % (1 + usize::from(*len)) == 0 =>
            {
                for item in list.chunks(1 + usize::from(*len)) {
                    for servo in awake.iter_mut().filter(|servo| servo.id == item[0]) {
                        if servo.write(usize::from(*address), &item[1..]).is_err() {
                            complaints.push(format!("servo {} refused a goal", servo.id));
                        }
                    }
                }
            }
            (0x82, [address, len, list @ ..]) if id == 254 && *kind == Kind::Sts && !list.is_empty() => {
                let from = usize::from(*address);
                for asked in list {
                    let Some(servo) = awake.iter().find(|servo| servo.id == *asked) else { break };
                    let mut answer = vec![servo.state];
                    answer.extend(&servo.memory[from..from + usize::from(*len)]);
                    answers.push((0, packet(servo.id, &answer)));
                }
            }
            (0x82 | 0x83, _) => complaints.push(format!("a malformed instruction {code:#x}")),
            _ => {
                for servo in awake.iter_mut().filter(|servo| id == 254 || id == servo.id) {
                    let Some(result) = servo.carry_out(code, parameters, now) else { continue };
                    if result.is_err() {
                        complaints.push(format!("servo {} refused {code:#x}", servo.id));
                    }
                    if id != 254 {
                        let error = servo.state | result.as_ref().err().copied().unwrap_or(0);
                        let mut answer = vec![error];
                        answer.extend(result.unwrap_or_default());
                        answers.push((0, packet(servo.id, &answer)));
                    }
                }
            }
        }
        answers
    }
}

impl Servos for Protocol1 {
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
        (2, 3)
    }

    fn refuse(&self, bytes: &[u8], number: u8) -> Vec<u8> {
        packet(bytes[2], &[number])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_servos_speak_as_the_manual() {
        assert_eq!(packet(1, &[1]), [0xFF, 0xFF, 1, 2, 1, 0xFB]);
        let mut servos = Protocol1::new(Kind::Ax, &[(1, 512)]);
        let read = [0xFF, 0xFF, 0x01, 0x04, 0x02, 0x2B, 0x01, 0xCC];
        assert_eq!(servos.hear(&read, 0), [(0, vec![0xFF, 0xFF, 0x01, 0x03, 0x00, 21, 0xE6])]);
    }
}
