//! One instruction packet, carried out by every servo that it concerns.

use crate::dynamixel_servo::DynamixelServo;
use crate::virtual_bus::Event;
use servo_wire::dynamixel::instruction::ALERT;
use servo_wire::dynamixel::packet::{HEADER, max_packet_len};
use servo_wire::dynamixel::{BROADCAST_ID, ErrorNumber, Instruction, Packet, PacketWriter, crc};

/// What a servo did: the parameters of its answer and the goal position that it took.
type Done = Result<(Vec<u8>, Option<i32>), ErrorNumber>;

/// Answers of the servos, and what the tap is told.
pub(crate) struct Answers<'a> {
    pub now_us: u64,
    pub tap: &'a mut dyn FnMut(Event),
    pub out: &'a mut Vec<u8>,
}

/// Carries out `packet`; the answers are appended to `answers.out` in the order of the bus.
pub(crate) fn execute(servos: &mut [DynamixelServo], packet: &Packet<'_>, answers: &mut Answers<'_>) {
    servos.iter_mut().for_each(DynamixelServo::hear);
    let instruction = Instruction::from_code(packet.instruction);
    let parameters = packet.parameters;
    if packet.id != BROADCAST_ID {
        return single(servos, packet, answers);
    }
    match instruction {
        Some(Instruction::Ping) => {
            servos.sort_by_key(|servo| servo.id());
            servos.iter().for_each(|servo| answers.answer(servo, &servo.identity()));
        }
        Some(Instruction::SyncRead | Instruction::BulkRead) => {
            for Item { id, address, len } in read_list(packet) {
                let asked = servos.iter().find(|servo| servo.id() == id && servo.return_level() > 0);
                asked.into_iter().for_each(|servo| answers.answer(servo, &servo.read(address, len)));
            }
        }
        Some(Instruction::FastSyncRead | Instruction::FastBulkRead) => fast_read(servos, packet, answers),
        Some(Instruction::SyncWrite) => {
            let Some((&[a0, a1, l0, l1], values)) = parameters.split_first_chunk() else { return };
            let len = usize::from(u16::from_le_bytes([l0, l1]));
            for value in values.chunks_exact(1 + len) {
                answers.write(servos, value[0], u16::from_le_bytes([a0, a1]), &value[1..]);
            }
        }
        Some(Instruction::BulkWrite) => {
            let mut rest = parameters;
            while let Some((&[id, a0, a1, l0, l1], data)) = rest.split_first_chunk() {
                let Some((data, later)) = data.split_at_checked(usize::from(u16::from_le_bytes([l0, l1])))
                else {
                    return;
                };
                answers.write(servos, id, u16::from_le_bytes([a0, a1]), data);
                rest = later;
            }
        }
        // Broadcast never resets everything, else all servos would get the same id.
        Some(Instruction::FactoryReset) if parameters == [0xFF] => {}
        Some(
            Instruction::Write
            | Instruction::RegWrite
            | Instruction::Action
            | Instruction::Reboot
            | Instruction::FactoryReset
            | Instruction::Clear,
        ) => {
            for servo in servos {
                let done = carry_out(servo, instruction, parameters, false);
                answers.tell(servo.id(), &done);
            }
        }
        Some(Instruction::Read | Instruction::Status) | None => {}
    }
}

/// An instruction to one id: its servo obeys and answers, those with this secondary id obey.
fn single(servos: &mut [DynamixelServo], packet: &Packet<'_>, answers: &mut Answers<'_>) {
    let instruction = Instruction::from_code(packet.instruction);
    if instruction == Some(Instruction::Status) {
        return;
    }
    let needed_level = match instruction {
        Some(Instruction::Ping) => 0,
        Some(Instruction::Read) => 1,
        _ => 2,
    };
    for servo in servos {
        let is_addressed = servo.id() == packet.id;
        if !is_addressed && !servo.follows(packet.id) {
            continue;
        }
        // A write may change the level itself, a reset the id: what counts is how the servo was asked.
        let (id, level) = (servo.id(), servo.return_level());
        let done = carry_out(servo, instruction, packet.parameters, !is_addressed);
        answers.tell(id, &done);
        if is_addressed && level >= needed_level {
            answers.status(id, servo.alert(), &done.map(|(answer, _)| answer));
        }
    }
}

fn carry_out(
    servo: &mut DynamixelServo,
    instruction: Option<Instruction>,
    parameters: &[u8],
    as_group: bool,
) -> Done {
    let quiet = |goal| (Vec::new(), goal);
    let write_parameters = || match parameters.split_first_chunk() {
        Some((&address, data)) => Ok((u16::from_le_bytes(address), data)),
        None => Err(ErrorNumber::DataLength),
    };
    match instruction {
        Some(Instruction::Ping) => Ok((servo.identity()?, None)),
        Some(Instruction::Read) => {
            let &[a0, a1, l0, l1] = parameters else { return Err(ErrorNumber::DataLength) };
            let answer = servo.read(u16::from_le_bytes([a0, a1]), u16::from_le_bytes([l0, l1]))?;
            Ok((answer, None))
        }
        Some(Instruction::Write) => {
            let (address, data) = write_parameters()?;
            servo.write(address, data, as_group).map(quiet)
        }
        Some(Instruction::RegWrite) => {
            let (address, data) = write_parameters()?;
            servo.register(address, data, as_group).map(|()| quiet(None))
        }
        Some(Instruction::Action) => servo.action().map(quiet),
        Some(Instruction::Reboot) => {
            servo.reboot();
            Ok(quiet(None))
        }
        Some(Instruction::FactoryReset) if !as_group => {
            let &[option] = parameters else { return Err(ErrorNumber::DataLength) };
            servo.factory_reset(option).map(|()| quiet(None))
        }
        Some(Instruction::Clear) => servo.clear(parameters).map(|()| quiet(None)),
        _ => Err(ErrorNumber::Instruction),
    }
}

/// What one servo is asked for in a read of several.
struct Item {
    id: u8,
    address: u16,
    len: u16,
}

/// The servos that a sync read or bulk read asks, in order; empty when the packet is malformed.
fn read_list(packet: &Packet<'_>) -> Vec<Item> {
    let is_bulk =
        [Instruction::BulkRead as u8, Instruction::FastBulkRead as u8].contains(&packet.instruction);
    if is_bulk {
        let (items, _) = packet.parameters.as_chunks();
        return items
            .iter()
            .map(|&[id, a0, a1, l0, l1]| Item {
                id,
                address: u16::from_le_bytes([a0, a1]),
                len: u16::from_le_bytes([l0, l1]),
            })
            .collect();
    }
    let Some((&[a0, a1, l0, l1], ids)) = packet.parameters.split_first_chunk() else { return Vec::new() };
    let (address, len) = (u16::from_le_bytes([a0, a1]), u16::from_le_bytes([l0, l1]));
    ids.iter().map(|&id| Item { id, address, len }).collect()
}

/// One joint answer, without stuffing: the first servo sends the header with everybody's length, each sends error, id,
/// data and the checksum of all bytes so far. A servo that is missing ends it, since the next waits for it.
///
/// A servo that must refuse sends zeros as data, or the length of the answer would be wrong.
fn fast_read(servos: &[DynamixelServo], packet: &Packet<'_>, answers: &mut Answers<'_>) {
    let items = read_list(packet);
    let length = 1 + items.iter().map(|item| usize::from(item.len) + 4).sum::<usize>();
    let Ok(length) = u16::try_from(length) else { return };
    let mut checksum = 0;
    let mut send = |bytes: &[u8]| {
        checksum = crc::update(checksum, bytes);
        answers.out.extend(bytes);
        checksum
    };
    for (place, item) in items.iter().enumerate() {
        let answers = |servo: &&DynamixelServo| servo.return_level() > 0 && servo.has_fast_reads();
        let Some(servo) = servos.iter().filter(answers).find(|servo| servo.id() == item.id) else {
            return;
        };
        if place == 0 {
            send(&HEADER);
            send(&[BROADCAST_ID]);
            send(&length.to_le_bytes());
            send(&[Instruction::Status as u8]);
        }
        let answer = servo.read(item.address, item.len);
        send(&[error_byte(servo.alert(), answer.as_ref().err()), item.id]);
        let so_far = send(&answer.unwrap_or_else(|_| vec![0; usize::from(item.len)]));
        send(&so_far.to_le_bytes());
    }
}

fn error_byte(alert: bool, error: Option<&ErrorNumber>) -> u8 {
    let alert = if alert { ALERT } else { 0 };
    alert | error.map_or(0, |&error| error as u8)
}

impl Answers<'_> {
    /// A write inside a sync or bulk write, which nobody answers.
    fn write(&mut self, servos: &mut [DynamixelServo], id: u8, address: u16, data: &[u8]) {
        for servo in servos {
            let own = servo.id() == id;
            if own || servo.follows(id) {
                let done = servo.write(address, data, !own).map(|goal| (Vec::new(), goal));
                self.tell(servo.id(), &done);
            }
        }
    }

    fn tell(&mut self, id: u8, done: &Done) {
        let time_us = self.now_us;
        match *done {
            Ok((_, Some(position))) => (self.tap)(Event::Goal { time_us, id, position }),
            Ok((_, None)) => {}
            Err(error) => (self.tap)(Event::Refused { time_us, id, error }),
        }
    }

    fn answer(&mut self, servo: &DynamixelServo, result: &Result<Vec<u8>, ErrorNumber>) {
        self.status(servo.id(), servo.alert(), result);
    }

    /// Appends a status packet.
    pub(crate) fn status(&mut self, id: u8, alert: bool, result: &Result<Vec<u8>, ErrorNumber>) {
        let parameters = result.as_deref().unwrap_or_default();
        let mut buffer = vec![0; max_packet_len(1 + parameters.len())];
        let packet = PacketWriter::new(&mut buffer, id, Instruction::Status)
            .and_then(|mut writer| {
                writer.push(&[error_byte(alert, result.as_ref().err())])?;
                writer.push(parameters)?;
                writer.finish()
            })
            .expect("the buffer has the length of the longest packet, which a control table bounds");
        self.out.extend(packet);
    }
}
