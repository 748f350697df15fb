//! What the servos do on the wire, seen from a client.

use crate::config::{ConfigError, ServoConfig};
use crate::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use crate::virtual_bus::{Disturbance, Event, START_US, VirtualBus};
use servo_wire::bus::Goal;
use servo_wire::dynamixel::instruction::ALERT;
use servo_wire::dynamixel::table::*;
use servo_wire::dynamixel::{BROADCAST_ID, ErrorNumber, Framer, Instruction, PacketWriter, goal_positions};

/// Id, error byte and parameters of a status packet.
type Answer = (u8, u8, Vec<u8>);

struct Client {
    bus: DynamixelServos,
    now_us: u64,
    events: Vec<Event>,
}

impl Client {
    fn new(ids: &[u8]) -> Self {
        Self::with(&DynamixelConfig::with_ids(ids))
    }

    fn with(config: &DynamixelConfig) -> Self {
        Self { bus: DynamixelServos::new(config).unwrap(), now_us: 0, events: Vec::new() }
    }

    fn raw(&mut self, bytes: &[u8]) -> Vec<u8> {
        let events = &mut self.events;
        self.bus.receive(bytes, self.now_us, &mut |event| events.push(event))
    }

    fn send(&mut self, id: u8, instruction: Instruction, parameters: &[u8]) -> Vec<Answer> {
        let reply = self.raw(&packet(id, instruction, parameters));
        let mut framer = Framer::<2048>::new();
        let mut bytes = &reply[..];
        let mut answers = Vec::new();
        while let Some(packet) = framer.feed(&mut bytes) {
            let packet = packet.unwrap();
            let status = packet.status().unwrap();
            answers.push((status.id, status.error, status.parameters.to_vec()));
        }
        answers
    }

    /// The error byte of the one answer.
    fn write(&mut self, id: u8, register: Register, value: i32) -> u8 {
        let mut parameters = register.address.to_le_bytes().to_vec();
        parameters.extend(&value.to_le_bytes()[..usize::from(register.len)]);
        let answers = self.send(id, Instruction::Write, &parameters);
        assert_eq!(answers.len(), 1, "{answers:?}");
        assert_eq!((answers[0].0, &answers[0].2[..]), (id, &[][..]));
        answers[0].1
    }

    fn read(&mut self, id: u8, register: Register) -> i32 {
        let [a0, a1] = register.address.to_le_bytes();
        let answers = self.send(id, Instruction::Read, &[a0, a1, register.len as u8, 0]);
        let [(from, error, bytes)] = &answers[..] else { panic!("{answers:?}") };
        assert_eq!((*from, error & !ALERT), (id, 0));
        bytes.iter().rev().fold(0, |value, &byte| value << 8 | i32::from(byte))
    }

    fn wait_ms(&mut self, ms: u64) {
        self.now_us += ms * 1000;
    }
}

fn packet(id: u8, instruction: Instruction, parameters: &[u8]) -> Vec<u8> {
    let mut buffer = [0; 2048];
    let mut writer = PacketWriter::new(&mut buffer, id, instruction).unwrap();
    writer.push(parameters).unwrap();
    writer.finish().unwrap().to_vec()
}

const CRC: u8 = ErrorNumber::Crc as u8;
const ACCESS: u8 = ErrorNumber::Access as u8;
const RANGE: u8 = ErrorNumber::DataRange as u8;
const LENGTH: u8 = ErrorNumber::DataLength as u8;
const LIMIT: u8 = ErrorNumber::DataLimit as u8;
const INSTRUCTION: u8 = ErrorNumber::Instruction as u8;
const FAIL: u8 = ErrorNumber::ResultFail as u8;

fn at(id: u8, position: i32) -> ServoConfig {
    ServoConfig { position, ..ServoConfig::new(id) }
}

#[test]
fn a_ping_names_the_model() {
    let mut client = Client::new(&[9, 1, 252]);
    let identity = vec![0xFC, 0x03, 46];
    assert_eq!(client.send(9, Instruction::Ping, &[]), [(9, 0, identity.clone())]);
    assert_eq!(client.send(10, Instruction::Ping, &[]), []);
    let all = client.send(BROADCAST_ID, Instruction::Ping, &[]);
    assert_eq!(all, [1, 9, 252].map(|id| (id, 0, identity.clone())));
}

/// The e-Manual's examples of Sync Read and Fast Sync Read, answers byte by byte.
#[test]
fn reads_of_several_servos_are_those_of_the_manual() {
    let servos = vec![at(1, 166), at(2, 2079), at(3, 166), at(4, 1023), at(7, 2079)];
    let mut client = Client::with(&DynamixelConfig { servos, ..DynamixelConfig::with_ids(&[]) });
    let answer = client.raw(&packet(BROADCAST_ID, Instruction::SyncRead, &[0x84, 0, 4, 0, 1, 2]));
    let expected = [
        0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x08, 0x00, 0x55, 0x00, 0xA6, 0x00, 0x00, 0x00, 0x8C, 0xC0, 0xFF, 0xFF,
        0xFD, 0x00, 0x02, 0x08, 0x00, 0x55, 0x00, 0x1F, 0x08, 0x00, 0x00, 0xBA, 0xBE,
    ];
    assert_eq!(answer, expected);
    let answer = client.raw(&packet(BROADCAST_ID, Instruction::FastSyncRead, &[0x84, 0, 4, 0, 3, 7, 4]));
    let expected = [
        0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x19, 0x00, 0x55, 0x00, 0x03, 0xA6, 0x00, 0x00, 0x00, 0x84, 0x08, 0x00,
        0x07, 0x1F, 0x08, 0x00, 0x00, 0x16, 0xCA, 0x00, 0x04, 0xFF, 0x03, 0x00, 0x00, 0xD1, 0x9E,
    ];
    assert_eq!(answer, expected);
    let items = [4, 0x84, 0, 4, 0, 1, 0x92, 0, 1, 0];
    assert_eq!(
        client.send(BROADCAST_ID, Instruction::BulkRead, &items),
        [(4, 0, vec![0xFF, 3, 0, 0]), (1, 0, vec![30])]
    );
    let fast = client.send(BROADCAST_ID, Instruction::FastBulkRead, &items);
    let [(BROADCAST_ID, 0, bytes)] = &fast[..] else { panic!("{fast:?}") };
    assert_eq!((&bytes[..5], &bytes[7..10]), (&[4, 0xFF, 3, 0, 0][..], &[0, 1, 30][..]));
}

#[test]
fn a_missing_servo_ends_a_joint_answer_only() {
    let mut client = Client::new(&[1, 3]);
    let ids: Vec<u8> = client
        .send(BROADCAST_ID, Instruction::SyncRead, &[0x84, 0, 4, 0, 3, 2, 1])
        .iter()
        .map(|a| a.0)
        .collect();
    assert_eq!(ids, [3, 1]);
    let cut = client.raw(&packet(BROADCAST_ID, Instruction::FastSyncRead, &[0x84, 0, 4, 0, 3, 2, 1]));
    assert_eq!((cut.len(), cut[5]), (16, 25));
    assert_eq!(
        client.raw(&packet(BROADCAST_ID, Instruction::FastSyncRead, &[0x84, 0, 4, 0, 2, 1])),
        [0_u8; 0]
    );
}

#[test]
fn refusals_have_the_numbers_of_the_manual() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, MODEL_NUMBER, 1), ACCESS);
    assert_eq!(client.write(1, PRESENT_POSITION, 1), ACCESS);
    assert_eq!(client.write(1, LED, 2), RANGE);
    assert_eq!(client.write(1, OPERATING_MODE, 2), RANGE);
    assert_eq!(client.write(1, DRIVE_MODE, 2), RANGE);
    assert_eq!(client.write(1, GOAL_POSITION, 4096), LIMIT);
    assert_eq!(client.write(1, GOAL_POSITION, -1), LIMIT);
    assert_eq!(client.write(1, GOAL_VELOCITY, -201), LIMIT);
    assert_eq!(client.send(1, Instruction::Write, &[116, 0, 1, 0]), [(1, LENGTH, vec![])]);
    assert_eq!(client.send(1, Instruction::Write, &[116]), [(1, LENGTH, vec![])]);
    assert_eq!(client.send(1, Instruction::Read, &[0, 3, 1, 0]), [(1, ACCESS, vec![])]);
    assert_eq!(client.send(1, Instruction::Action, &[]), [(1, INSTRUCTION, vec![])]);
    assert_eq!(client.send(1, Instruction::SyncRead, &[0, 0, 1, 0, 1]), [(1, INSTRUCTION, vec![])]);
    assert_eq!(client.send(1, Instruction::Clear, &[1, 0, 0, 0, 0]), [(1, RANGE, vec![])]);
    assert_eq!(client.send(1, Instruction::FactoryReset, &[3]), [(1, RANGE, vec![])]);
    let mut wrong = packet(1, Instruction::Ping, &[]);
    wrong[9] ^= 1;
    let reply = client.raw(&wrong);
    assert_eq!((reply[4], reply[8]), (1, CRC));
    wrong = packet(1, Instruction::Ping, &[]);
    wrong[7] = 0x77;
    let body = wrong.len() - 2;
    let checksum = servo_wire::dynamixel::crc::update(0, &wrong[..body]).to_le_bytes();
    wrong[body..].copy_from_slice(&checksum);
    assert_eq!(client.raw(&wrong)[8], INSTRUCTION);
}

#[test]
fn torque_locks_the_eeprom() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, TORQUE_ENABLE, 1), 0);
    assert_eq!(client.write(1, MAX_POSITION_LIMIT, 3000), ACCESS);
    assert_eq!(client.write(1, TORQUE_ENABLE, 0), 0);
    assert_eq!(client.write(1, MAX_POSITION_LIMIT, 3000), 0);
    assert_eq!(client.write(1, GOAL_POSITION, 3001), LIMIT);
    assert_eq!(client.send(1, Instruction::Reboot, &[]), [(1, 0, vec![])]);
    assert_eq!(client.read(1, MAX_POSITION_LIMIT), 3000);
}

#[test]
fn a_new_id_is_answered_by_the_old_one() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, ID, 5), 0);
    assert_eq!(client.send(1, Instruction::Ping, &[]), []);
    assert_eq!(client.read(5, ID), 5);
    assert_eq!(client.send(5, Instruction::FactoryReset, &[0x01]), [(5, 0, vec![])]);
    assert_eq!(client.read(5, ID), 5);
    assert_eq!(client.send(BROADCAST_ID, Instruction::FactoryReset, &[0xFF]), []);
    assert_eq!(client.read(5, ID), 5);
    assert_eq!(client.send(5, Instruction::FactoryReset, &[0xFF]), [(5, 0, vec![])]);
    assert_eq!(client.read(1, ID), 1);
}

#[test]
fn the_status_return_level_silences_answers() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, STATUS_RETURN_LEVEL, 1), 0);
    assert_eq!(client.send(1, Instruction::Write, &[65, 0, 1]), []);
    assert_eq!(client.read(1, LED), 1);
    assert_eq!(client.send(1, Instruction::Write, &[68, 0, 0]), []);
    assert_eq!(client.send(1, Instruction::Read, &[65, 0, 1, 0]), []);
    assert_eq!(client.send(BROADCAST_ID, Instruction::SyncRead, &[65, 0, 1, 0, 1]), []);
    assert_eq!(client.send(1, Instruction::Ping, &[]).len(), 1);
}

#[test]
fn it_moves_with_its_profile() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, GOAL_POSITION, 3000), 0);
    client.wait_ms(1000);
    assert_eq!(client.read(1, PRESENT_POSITION), 2048, "moved without torque");
    assert_eq!(client.write(1, TORQUE_ENABLE, 1), 0);
    assert_eq!(client.read(1, GOAL_POSITION), 2048, "the goal is the present position when torque comes on");
    // 64 units of velocity are 1000.5 positions a second: 1000 positions take a second.
    assert_eq!(client.write(1, PROFILE_VELOCITY, 64), 0);
    assert_eq!(client.write(1, GOAL_POSITION, 3048), 0);
    assert_eq!((client.read(1, MOVING), client.read(1, MOVING_STATUS)), (1, 0x12));
    client.wait_ms(500);
    assert_eq!((client.read(1, PRESENT_POSITION), client.read(1, PRESENT_VELOCITY)), (2548, 64));
    client.wait_ms(501);
    assert_eq!((client.read(1, PRESENT_POSITION), client.read(1, PRESENT_VELOCITY)), (3048, 0));
    assert_eq!((client.read(1, MOVING), client.read(1, MOVING_STATUS)), (0, 0x11));
    // 4 units of acceleration are 976.6 positions/s^2: the trapezoid takes 1000/1000.5 + 1000.5/976.6 = 2.02 s.
    assert_eq!(client.write(1, PROFILE_ACCELERATION, 4), 0);
    assert_eq!(client.write(1, GOAL_POSITION, 2048), 0);
    assert_eq!(client.read(1, MOVING_STATUS), 0x22, "1000 positions are too few for full speed");
    assert_eq!(client.write(1, GOAL_POSITION, 1948), 0);
    assert_eq!(client.read(1, MOVING_STATUS), 0x32);
    client.wait_ms(2100);
    assert_eq!(client.read(1, MOVING), 1);
    client.wait_ms(50);
    assert_eq!((client.read(1, MOVING), client.read(1, PRESENT_POSITION)), (0, 1948));
}

#[test]
fn a_time_based_profile_takes_its_time() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, DRIVE_MODE, 4), 0);
    assert_eq!(client.write(1, TORQUE_ENABLE, 1), 0);
    assert_eq!(client.write(1, PROFILE_VELOCITY, 1000), 0);
    assert_eq!(client.write(1, PROFILE_ACCELERATION, 300), 0);
    assert_eq!(client.write(1, GOAL_POSITION, 3000), 0);
    client.wait_ms(985);
    assert_eq!(client.read(1, MOVING), 1);
    client.wait_ms(30);
    assert_eq!((client.read(1, MOVING), client.read(1, PRESENT_POSITION)), (0, 3000));
}

#[test]
fn how_often_one_looks_changes_nothing() {
    let run = |interval_us: u64| {
        let mut client = Client::new(&[1]);
        client.write(1, TORQUE_ENABLE, 1);
        client.write(1, PROFILE_VELOCITY, 100);
        client.write(1, PROFILE_ACCELERATION, 10);
        client.write(1, GOAL_POSITION, 4000);
        while client.now_us < 700_000 {
            client.now_us += interval_us;
            client.bus.advance_to(client.now_us);
        }
        client.now_us = 700_000;
        (client.read(1, PRESENT_POSITION), client.read(1, PRESENT_VELOCITY))
    };
    assert_eq!(run(7), run(700_000));
    assert_eq!(run(999), run(700_000));
}

#[test]
fn velocity_mode_turns_and_forgets_no_turns() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, OPERATING_MODE, 1), 0);
    assert_eq!(client.write(1, TORQUE_ENABLE, 1), 0);
    assert_eq!(client.write(1, GOAL_VELOCITY, -100), 0);
    client.wait_ms(10_000);
    assert_eq!(client.read(1, PRESENT_VELOCITY), -100);
    assert_eq!(client.read(1, PRESENT_POSITION), 2048 - 15_633);
    assert_eq!(client.send(1, Instruction::Clear, &[1, 0x44, 0x58, 0x4C, 0x22]), [(1, FAIL, vec![])]);
    assert_eq!(client.write(1, GOAL_VELOCITY, 0), 0);
    client.wait_ms(10);
    assert_eq!(client.send(1, Instruction::Clear, &[1, 0x44, 0x58, 0x4C, 0x22]), [(1, 0, vec![])]);
    assert_eq!(client.read(1, PRESENT_POSITION), (2048 - 15_633_i32).rem_euclid(4096));
}

#[test]
fn extended_position_mode_goes_round_and_round() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, OPERATING_MODE, 4), 0);
    assert_eq!(client.write(1, TORQUE_ENABLE, 1), 0);
    assert_eq!(client.write(1, GOAL_POSITION, 1_048_576), RANGE);
    assert_eq!(client.write(1, GOAL_POSITION, -8192), 0);
    client.wait_ms(5000);
    assert_eq!(client.read(1, PRESENT_POSITION), -8192);
    assert_eq!(client.send(1, Instruction::Reboot, &[]).len(), 1);
    assert_eq!(client.read(1, PRESENT_POSITION), 0);
}

#[test]
fn reverse_and_homing_change_how_the_shaft_is_seen() {
    let mut client =
        Client::with(&DynamixelConfig { servos: vec![at(1, 1000)], ..DynamixelConfig::with_ids(&[]) });
    assert_eq!(client.write(1, HOMING_OFFSET, 24), 0);
    assert_eq!(client.read(1, PRESENT_POSITION), 1024);
    assert_eq!(client.write(1, HOMING_OFFSET, 2000), 0);
    assert_eq!(
        client.read(1, PRESENT_POSITION),
        1000,
        "more than a quarter turn does not count in position mode"
    );
    assert_eq!(client.write(1, DRIVE_MODE, 1), 0);
    assert_eq!(client.read(1, PRESENT_POSITION), -1000);
    assert_eq!(client.write(1, TORQUE_ENABLE, 1), 0);
    assert_eq!(client.read(1, PRESENT_POSITION), 3096);
}

#[test]
fn registered_writes_wait_for_action() {
    let mut client = Client::new(&[1, 2]);
    for id in [1, 2] {
        assert_eq!(client.send(id, Instruction::RegWrite, &[65, 0, 1]), [(id, 0, vec![])]);
        assert_eq!((client.read(id, REGISTERED_INSTRUCTION), client.read(id, LED)), (1, 0));
    }
    assert_eq!(client.send(1, Instruction::RegWrite, &[65, 0, 2]), [(1, RANGE, vec![])]);
    assert_eq!(client.send(BROADCAST_ID, Instruction::Action, &[]), []);
    for id in [1, 2] {
        assert_eq!((client.read(id, REGISTERED_INSTRUCTION), client.read(id, LED)), (0, 1));
    }
}

#[test]
fn the_tap_sees_goals_and_refusals() {
    let mut client = Client::new(&[1, 2, 3]);
    client.wait_ms(3);
    let goals = [(1, 1000), (2, 5000), (3, 3000)].map(|(id, position)| Goal { id, position });
    let mut buffer = [0; 64];
    let sync = goal_positions(&mut buffer, &goals).unwrap().to_vec();
    assert_eq!(client.raw(&sync), [0_u8; 0]);
    client.send(BROADCAST_ID, Instruction::BulkWrite, &[2, 116, 0, 4, 0, 1, 0, 0, 0, 1, 65, 0, 1, 0, 1]);
    client.send(3, Instruction::RegWrite, &[116, 0, 7, 0, 0, 0]);
    client.wait_ms(4);
    client.send(BROADCAST_ID, Instruction::Action, &[]);
    let goal = |time_us, id, position| Event::Goal { time_us, id, position };
    let refused = |time_us, id, error| Event::Refused { time_us, id, error };
    assert_eq!(
        client.events,
        [
            goal(3000, 1, 1000),
            refused(3000, 2, ErrorNumber::DataLimit),
            goal(3000, 3, 3000),
            goal(3000, 2, 1),
            refused(7000, 1, ErrorNumber::Instruction),
            refused(7000, 2, ErrorNumber::Instruction),
            goal(7000, 3, 7),
        ]
    );
    assert_eq!(client.read(1, LED), 1);
}

#[test]
fn the_watchdog_stops_a_servo_that_hears_nothing() {
    let mut client = Client::new(&[1]);
    client.write(1, TORQUE_ENABLE, 1);
    client.write(1, PROFILE_VELOCITY, 20);
    client.write(1, GOAL_POSITION, 4000);
    assert_eq!(client.write(1, BUS_WATCHDOG, 5), 0);
    client.wait_ms(90);
    let before = client.read(1, PRESENT_POSITION);
    assert_eq!(client.read(1, BUS_WATCHDOG), 5);
    client.wait_ms(1000);
    assert_eq!(client.read(1, BUS_WATCHDOG), 0xFF);
    // 312.7 positions a second for the 100 ms until the watchdog looks.
    assert_eq!(client.read(1, PRESENT_POSITION) - before, 32);
    assert_eq!(client.write(1, GOAL_POSITION, 3000), RANGE);
    assert_eq!(client.write(1, BUS_WATCHDOG, 5), RANGE);
    assert_eq!(client.write(1, BUS_WATCHDOG, 0), 0);
    assert_eq!(client.write(1, GOAL_POSITION, 3000), 0);
}

#[test]
fn heat_ends_torque_until_a_reboot() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, TEMPERATURE_LIMIT, 20), ALERT);
    assert_eq!(client.read(1, HARDWARE_ERROR_STATUS), 4);
    assert_eq!(client.write(1, TORQUE_ENABLE, 1), ALERT | FAIL);
    assert_eq!(client.write(1, TEMPERATURE_LIMIT, 80), ALERT, "the error stays");
    assert_eq!(client.send(1, Instruction::Reboot, &[]), [(1, 0, vec![])]);
    assert_eq!(client.write(1, TORQUE_ENABLE, 1), 0);
    assert_eq!(client.read(1, HARDWARE_ERROR_STATUS), 0);
}

#[test]
fn a_voltage_error_that_shutdown_does_not_name_only_alerts() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, MIN_VOLTAGE_LIMIT, 130), ALERT);
    assert_eq!(client.write(1, TORQUE_ENABLE, 1), ALERT);
    assert_eq!(client.read(1, TORQUE_ENABLE), 1);
}

#[test]
fn a_secondary_id_is_obeyed_in_silence() {
    let mut client = Client::new(&[1, 2, 3]);
    for id in [1, 2] {
        assert_eq!(client.write(id, SECONDARY_ID, 3), 0);
    }
    assert_eq!(client.send(3, Instruction::Write, &[65, 0, 1]), [(3, 0, vec![])]);
    assert_eq!([1, 2, 3].map(|id| client.read(id, LED)), [1, 1, 1]);
    assert_eq!(client.send(3, Instruction::Write, &[31, 0, 70]), [(3, 0, vec![])]);
    assert_eq!([1, 2, 3].map(|id| client.read(id, TEMPERATURE_LIMIT)), [80, 80, 70]);
}

#[test]
fn torque_can_come_on_with_the_goal() {
    let mut client = Client::new(&[1]);
    assert_eq!(client.write(1, DRIVE_MODE, 8), 0);
    assert_eq!(client.write(1, GOAL_POSITION, 1000), 0);
    client.wait_ms(2000);
    assert_eq!((client.read(1, TORQUE_ENABLE), client.read(1, PRESENT_POSITION)), (1, 1000));
}

#[test]
fn half_a_packet_is_forgotten_after_a_pause() {
    let mut client = Client::new(&[1]);
    let ping = packet(1, Instruction::Ping, &[]);
    assert_eq!(client.raw(&ping[..6]), [0_u8; 0]);
    assert_eq!(client.raw(&ping[6..]).len(), 14);
    assert_eq!(client.raw(&[0xFF, 0xFF, 0xFD, 0x00, 0x01, 0xF0, 0x00]), [0_u8; 0]);
    assert_eq!(client.raw(&ping), [0_u8; 0], "the bytes belong to the longer packet");
    client.wait_ms(2);
    assert_eq!(client.raw(&[]).len(), 14, "what was swallowed is found");
    assert_eq!(client.raw(&ping).len(), 14);
}

#[test]
fn impossible_servos_are_refused() {
    let new = |servos: Vec<ServoConfig>| {
        DynamixelServos::new(&DynamixelConfig { servos, ..DynamixelConfig::with_ids(&[]) })
            .err()
            .map(|error| error.to_string())
    };
    assert_eq!(new(vec![ServoConfig::new(253)]), Some(ConfigError::Id(253).to_string()));
    assert_eq!(
        new(vec![ServoConfig::new(5), ServoConfig::new(5)]),
        Some(ConfigError::Duplicate(5).to_string())
    );
    let limits = ServoConfig { min_position: 9, max_position: 8, ..ServoConfig::new(1) };
    assert_eq!(
        new(vec![limits]),
        Some(ConfigError::Limits { id: 1, min: 9, max: 8, most: 4095 }.to_string())
    );
    assert_eq!(new(vec![ServoConfig::new(0)]), None);
}

/// Whatever arrives, the servos neither panic nor forget how to answer.
#[test]
fn no_bytes_stop_the_bus() {
    let mut random = 0x9E37_79B9_7F4A_7C15_u64;
    let mut below = |bound: usize| {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 33) as usize % bound
    };
    let codes = [1, 2, 3, 4, 5, 6, 8, 0x10, 0x82, 0x83, 0x8A, 0x92, 0x93, 0x9A].map(Instruction::from_code);
    let mut client = Client::new(&[0, 1, 2]);
    for _ in 0..20_000 {
        let len = below(14);
        let parameters: Vec<u8> = (0..len)
            .map(|_| [0, 1, 2, 3, 4, 64, 65, 116, 132, 168, 224, 0xFD, 0xFE, 0xFF][below(14)])
            .collect();
        let id = [0, 1, 2, BROADCAST_ID][below(4)];
        let mut bytes = packet(id, codes[below(14)].unwrap(), &parameters);
        if below(4) == 0 {
            let place = below(bytes.len());
            bytes[place] ^= 1 << below(8);
        }
        client.now_us += below(4000) as u64;
        client.raw(&bytes);
    }
    assert!(client.events.iter().any(|event| matches!(event, Event::Refused { .. })));
    client.wait_ms(10);
    client.raw(&[]);
    assert_eq!(client.send(BROADCAST_ID, Instruction::Ping, &[]).len(), 3);
}

#[test]
fn what_happens_from_outside_happens_at_its_time() {
    let mut client = Client::new(&[1, 2]);
    let turn = |servo, position| Disturbance::Turn { servo, position };
    for (at_us, disturbance) in [
        (1_000_000, turn(1, 1000)),
        (2_000_000, Disturbance::Silence { servo: 2, seconds: 0.5 }),
        (3_000_000, Disturbance::Cut { seconds: 0.1 }),
        (4_000_000, turn(1, 3000)),
        (5_000_000, Disturbance::Restart { servo: 1 }),
    ] {
        client.bus.schedule(at_us, disturbance).unwrap();
    }
    assert_eq!(client.bus.schedule(0, turn(3, 0)), Err(ConfigError::Absent(3)));
    let ids = |client: &mut Client| {
        client.send(BROADCAST_ID, Instruction::Ping, &[]).into_iter().map(|(id, ..)| id).collect::<Vec<_>>()
    };
    assert_eq!((client.read(1, PRESENT_POSITION), ids(&mut client)), (2048, vec![1, 2]));
    client.now_us = 1_000_000;
    assert_eq!(client.read(1, PRESENT_POSITION), 1000);
    client.now_us = 2_499_999;
    assert_eq!(ids(&mut client), [1]);
    assert_eq!(client.bus.position(2), Some(2048));
    client.now_us = 2_500_000;
    assert_eq!(ids(&mut client), [1, 2]);
    client.now_us = 3_099_999;
    assert!(ids(&mut client).is_empty());
    client.now_us = 3_100_000;
    // What holds is not turned, and what has restarted does not hold.
    assert_eq!(client.write(1, TORQUE_ENABLE, 1), 0);
    client.now_us = 4_100_000;
    assert_eq!(client.read(1, PRESENT_POSITION), 1000);
    client.now_us = 5_000_000 + START_US - 1;
    assert_eq!(ids(&mut client), [2]);
    client.now_us += 1;
    assert_eq!(client.read(1, TORQUE_ENABLE), 0);
}
