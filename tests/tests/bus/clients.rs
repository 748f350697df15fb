//! Every instruction of the clients against the strict servos.

use crate::servos1::{self, Kind, Protocol1};
use crate::servos2::{XSeries, packet};
use crate::session::{BAUD, Port2, line, port, wire};
use crate::wire::Wire;
use embassy_futures::block_on;
use servo_wire::blocking::{Polled, PolledDelay};
use servo_wire::bus::{BusError, ERROR_ALERT, ERROR_OVERLOAD, ERROR_WATCHDOG, Goal, Reading, ServoBus};
use servo_wire::dynamixel::client::{BulkItem, FactoryReset};
use servo_wire::dynamixel::{BROADCAST_ID, DynamixelBus, DynamixelClient, MAX_ID};
use servo_wire::port::{Automatic, LineConfig, Port};
use servo_wire::protocol1;
use std::cell::RefCell;
use std::collections::VecDeque;

type Client2 = DynamixelClient<Wire<XSeries>, Wire<XSeries>, Wire<XSeries>>;

const IDS: [u8; 5] = [7, 1, 252, 0, 20];

fn rig() -> (Wire<XSeries>, Client2) {
    let wire = wire(XSeries::new(&IDS), None, line(false));
    let client = DynamixelClient::new(port(&wire, line(false)));
    (wire, client)
}

/// Present Position of a servo that nobody has moved.
fn position(id: u8) -> i32 {
    1000 * i32::from(id) + 500
}

#[test]
fn single_servo_instructions() {
    let (wire, mut client) = rig();
    for id in IDS {
        let (ping, _) = wire.run(client.ping(id));
        let ping = ping.unwrap();
        assert_eq!((ping.model, ping.firmware, ping.alert), (1020, 46, false));
        let mut data = [0; 4];
        assert_eq!(wire.run(client.read(id, 132, &mut data)).0, Ok(false));
        assert_eq!(i32::from_le_bytes(data), position(id));
    }
    let (missing, took) = wire.run(client.ping(99));
    assert_eq!(missing, Err(BusError::NoReply));
    // The answer would take 15 bytes with stuffing; 300 µs are the line's slack.
    assert_eq!(took, 100 + 150 + 300 + 1);
    assert_eq!(wire.run(client.write(7, 64, &[1])).0, Ok(false));
    // -131073 is FF FF FD FF: stuffed on the way there and back.
    let goal = (-131_073_i32).to_le_bytes();
    assert_eq!(wire.run(client.write(7, 116, &goal)).0, Ok(false));
    let mut data = [0; 4];
    assert_eq!(wire.run(client.read(7, 116, &mut data)).0, Ok(false));
    assert_eq!(data, goal);
    assert_eq!(wire.run(client.reg_write(1, 65, &[1])).0, Ok(false));
    assert_eq!(wire.run(client.action(1)).0, Ok(false));
    assert_eq!(wire.run(client.clear_turns(1)).0, Ok(false));
    assert_eq!(wire.run(client.factory_reset(252, FactoryReset::AllButIdAndBaud)).0, Ok(false));
    assert_eq!(wire.run(client.write(BROADCAST_ID, 64, &[1])).0, Ok(false));
    wire.servos(|bus| {
        assert!(bus.servos.iter().all(crate::servos2::Servo::torque));
        assert_eq!(bus.complaints, [""; 0]);
        for instruction in [1, 2, 3, 4, 5, 6, 0x10] {
            assert!(bus.seen.contains_key(&instruction), "{instruction:#x} was not seen");
        }
    });
    assert_eq!(wire.run(client.reboot(1)).0, Ok(false));
    assert_eq!(wire.run(client.ping(1)).0, Err(BusError::NoReply));
    wire.wait_us(30_000);
    assert!(wire.run(client.ping(1)).0.is_ok());
}

#[test]
fn refusals_carry_their_number_and_alerts_are_no_refusals() {
    let (wire, mut client) = rig();
    let refused = |number| Err(BusError::Refused(number));
    assert_eq!(wire.run(client.write(1, 132, &[0; 4])).0, refused(7));
    assert_eq!(wire.run(client.write(1, 65, &[2])).0, refused(4));
    assert_eq!(wire.run(client.write(1, 116, &[2])).0, refused(5));
    assert_eq!(wire.run(client.action(1)).0, refused(2));
    wire.servos(|bus| bus.servo(1).fail(ERROR_OVERLOAD));
    assert_eq!(wire.run(client.write(1, 65, &[1])).0, Ok(true));
    assert_eq!(wire.run(client.ping(1)).0.map(|ping| ping.alert), Ok(true));
    assert_eq!(wire.run(client.write(1, 64, &[1])).0, refused(1));
    let mut data = [0];
    assert_eq!(wire.run(client.read(1, 70, &mut data)).0, Ok(true));
    assert_eq!(data, [ERROR_OVERLOAD]);
}

#[test]
fn reads_of_many_keep_the_good_answers() {
    let (wire, mut client) = rig();
    let items: Vec<BulkItem> = IDS.iter().map(|&id| BulkItem { id, address: 132, len: 4 }).collect();
    for (dead, answering) in [(None, 5), (Some(0), 0), (Some(3), 3), (Some(4), 4)] {
        wire.servos(|bus| {
            for (at, servo) in bus.servos.iter_mut().enumerate() {
                servo.dead = dead == Some(at);
            }
        });
        for way in 0..4 {
            let mut found = Vec::new();
            let each = |at: usize, answer: servo_wire::dynamixel::client::Answer<'_>| {
                found.push((IDS[at], i32::from_le_bytes(answer.data.try_into().unwrap())));
            };
            let (result, _) = match way {
                0 => wire.run(client.sync_read(132, 4, &IDS, each)),
                1 => wire.run(client.fast_sync_read(132, 4, &IDS, each)),
                2 => wire.run(client.bulk_read(&items, each)),
                _ => wire.run(client.fast_bulk_read(&items, each)),
            };
            let expected: Vec<_> = IDS[..answering].iter().map(|&id| (id, position(id))).collect();
            assert_eq!(found, expected, "way {way}, dead {dead:?}");
            assert_eq!(result, if answering == 0 { Err(BusError::NoReply) } else { Ok(answering) });
        }
    }
    assert_eq!(wire.servos(|bus| bus.complaints.clone()), [""; 0]);
}

#[test]
fn bulk_reads_may_differ_and_bulk_writes_too() {
    let (wire, mut client) = rig();
    let long: &[u8] = &2000_i32.to_le_bytes();
    wire.run(client.bulk_write(&[(7, 116, long), (1, 65, &[1])])).0.unwrap();
    wire.run(client.sync_write(65, [(20, [1]), (0, [1])])).0.unwrap();
    let items = [
        BulkItem { id: 7, address: 116, len: 4 },
        BulkItem { id: 1, address: 65, len: 1 },
        BulkItem { id: 20, address: 64, len: 2 },
    ];
    for fast in [false, true] {
        let mut found = Vec::new();
        let each =
            |_: usize, answer: servo_wire::dynamixel::client::Answer<'_>| found.push(answer.data.to_vec());
        let (result, _) = match fast {
            true => wire.run(client.fast_bulk_read(&items, each)),
            false => wire.run(client.bulk_read(&items, each)),
        };
        assert_eq!((result, found), (Ok(3), vec![long.to_vec(), vec![1], vec![0, 1]]));
    }
    assert_eq!(wire.servos(|bus| bus.complaints.clone()), [""; 0]);
}

#[test]
fn a_broadcast_ping_finds_all_in_the_time_it_states() {
    let (wire, mut client) = rig();
    let mut found = Vec::new();
    let (count, took) = wire.run(client.broadcast_ping(|id, ping| found.push((id, ping.model))));
    assert_eq!(count, Ok(5));
    found.sort_unstable();
    assert_eq!(found, [0, 1, 7, 20, 252].map(|id| (id, 1020)));
    assert!((759_000..810_000).contains(&took), "{took} µs for {MAX_ID} ids");
}

#[test]
fn indirect_addresses_are_written_only_where_they_differ() {
    let (wire, mut client) = rig();
    let addresses: Vec<u16> = (132..136).chain([146]).collect();
    wire.run(client.set_indirect(7, 3, &addresses)).0.unwrap();
    let mut data = [0; 5];
    wire.run(client.read(7, 224 + 3, &mut data)).0.unwrap();
    assert_eq!((i32::from_le_bytes(data[..4].try_into().unwrap()), data[4]), (position(7), 27));
    let writes = wire.servos(|bus| bus.seen[&3]);
    wire.run(client.set_indirect(7, 3, &addresses)).0.unwrap();
    assert_eq!(wire.servos(|bus| bus.seen[&3]), writes);
    assert_eq!(wire.run(client.set_indirect(7, 24, &addresses)).0, Err(BusError::TooMany));
    assert_eq!(wire.servos(|bus| bus.complaints.clone()), [""; 0]);
}

#[test]
fn what_does_not_fit_the_buffer_is_said_before_anything_is_sent() {
    let wire = wire(XSeries::new(&IDS), None, line(false));
    let mut client = DynamixelClient::<_, _, _, 32>::new(port(&wire, line(false)));
    let each = |_: usize, _: servo_wire::dynamixel::client::Answer<'_>| {};
    assert_eq!(wire.run(client.read(1, 0, &mut [0; 100])).0, Err(BusError::TooMany));
    assert_eq!(wire.run(client.write(1, 0, &[0; 100])).0, Err(BusError::TooMany));
    assert_eq!(wire.run(client.fast_sync_read(0, 30, &[1], each)).0, Err(BusError::TooMany));
    assert_eq!(wire.run(client.sync_write(0, [(1, [0; 30])])).0, Err(BusError::TooMany));
    assert_eq!(wire.bytes().1, 0);
    // Parts of a joint answer are taken one by one, so many fit.
    assert_eq!(wire.run(client.fast_sync_read(132, 4, &IDS, each)).0, Ok(5));
}

#[test]
fn factory_return_delays_fit_in_the_line_that_states_them() {
    for (delay, expected) in [(0, Err(BusError::NoReply)), (500, Ok(false))] {
        let slow = LineConfig { return_delay_us: delay, slack_us: 200, ..line(false) };
        let wire = wire(XSeries::new(&IDS), None, slow);
        wire.servos(|bus| bus.servos.iter_mut().for_each(|servo| servo.set_return_delay(250)));
        let mut client = DynamixelClient::<_, _, _, 640>::new(port(&wire, slow));
        assert_eq!(wire.run(client.read(7, 132, &mut [0; 4])).0, expected);
        if expected.is_ok() {
            assert_eq!(wire.run(client.sync_read(132, 4, &IDS, |_, _| {})).0, Ok(5));
        }
    }
}

#[test]
fn a_reading_tells_all_of_a_servo() {
    let wire = wire(XSeries::new(&IDS), None, line(false));
    let mut bus = DynamixelBus::<_, _, _, 640>::new(DynamixelClient::new(port(&wire, line(false))));
    for index in 0..IDS.len() {
        wire.run(bus.ping(&IDS, index)).0.unwrap();
    }
    wire.run(bus.set_watchdog(&IDS, 100)).0.unwrap();
    wire.run(bus.set_torque(&IDS, 0, true)).0.unwrap();
    wire.servos(|servos| servos.servo(1).fail(ERROR_OVERLOAD));
    let read = |bus: &mut DynamixelBus<_, _, _, 640>| {
        let mut readings = [None; 5];
        wire.run(bus.read_all(&IDS, &mut readings)).0.unwrap();
        readings.map(Option::unwrap)
    };
    let reading = |id: u8, hardware_error, torque| Reading {
        position: position(id),
        temperature: Some(20 + id % 50),
        millivolts: Some(12_100),
        load: Some(-i16::from(id % 100)),
        hardware_error,
        torque: Some(torque),
    };
    let expected = [
        reading(7, 0, true),
        reading(1, ERROR_OVERLOAD, false),
        reading(252, 0, false),
        reading(0, 0, false),
        reading(20, 0, false),
    ];
    assert_eq!(read(&mut bus), expected);
    // Silence of 100 ms and more: the servos stop by themselves, and refuse goals until they are armed again.
    wire.wait_us(101_000);
    let stopped = read(&mut bus);
    assert!(stopped.iter().all(|reading| reading.hardware_error & ERROR_WATCHDOG != 0), "{stopped:?}");
    let goals = IDS.map(|id| Goal { id, position: 5 });
    wire.run(bus.write_goals(&goals)).0.unwrap();
    assert_eq!(wire.servos(|bus| bus.servo(7).goals.clone()), [0; 0]);
    wire.run(bus.set_watchdog(&IDS, 0)).0.unwrap();
    wire.run(bus.write_goals(&goals)).0.unwrap();
    assert_eq!(wire.servos(|bus| bus.servo(7).goals.clone()), [5]);
    assert_eq!(read(&mut bus)[0], Reading { position: 5, ..expected[0] });
    assert_eq!(expected[1].hardware_error & ERROR_ALERT, 0);
}

#[test]
fn a_servo_that_restarts_unasked_is_set_up_again_in_the_next_tick() {
    let wire = wire(XSeries::new(&IDS), None, line(false));
    let mut bus = DynamixelBus::<_, _, _, 640>::new(DynamixelClient::new(port(&wire, line(false))));
    for index in 0..IDS.len() {
        wire.run(bus.ping(&IDS, index)).0.unwrap();
        wire.run(bus.set_torque(&IDS, index, true)).0.unwrap();
    }
    let now = wire.now_us() * 1000;
    wire.servos(|servos| servos.servo(252).restart(now, 0));
    let mut readings = [None; 5];
    wire.run(bus.read_all(&IDS, &mut readings)).0.unwrap();
    let torque: Vec<_> = readings.iter().map(|reading| reading.unwrap().torque).collect();
    assert_eq!(torque, [true, true, false, true, true].map(Some));
}

#[test]
fn noise_before_an_answer_and_late_answers_are_skipped() {
    let (wire, mut client) = rig();
    // Answers of others and to other questions: another servo, another length, an instruction, a joint answer.
    for stray in [
        packet(1, &[0x55, 0, 1, 2, 3, 4]),
        packet(7, &[0x55, 0, 1, 2, 3]),
        packet(7, &[2, 132, 0, 4, 0]),
        packet(BROADCAST_ID, &[0x55, 0, 7, 1, 2, 3, 4]),
        vec![0xFF, 0xFF, 0xFD, 0x00, 7, 0x80, 0x01],
        vec![0xFF; 40],
    ] {
        let mut data = [0; 4];
        // Before the question it is dropped.
        wire.inject(&stray);
        assert_eq!(wire.run(client.read(7, 132, &mut data)).0, Ok(false));
        assert_eq!(i32::from_le_bytes(data), position(7));
    }
}

#[test]
fn a_cancelled_call_leaves_the_bus_usable() {
    let (wire, mut client) = rig();
    wire.let_cut();
    for micros in [0, 50, 139, 141, 160, 250] {
        let mut data = [0; 4];
        let mut timer = wire.clone();
        let limit = embedded_hal_async::delay::DelayNs::delay_us(&mut timer, micros);
        let (first, _) = wire.run(async {
            match embassy_futures::select::select(client.read(7, 132, &mut data), limit).await {
                embassy_futures::select::Either::First(result) => Some(result),
                embassy_futures::select::Either::Second(()) => None,
            }
        });
        assert_eq!(first, None, "after {micros} µs");
        wire.wait_us(2000);
        assert_eq!(wire.run(client.read(7, 132, &mut data)).0, Ok(false), "after {micros} µs");
        assert_eq!(i32::from_le_bytes(data), position(7));
    }
}

#[test]
fn protocol_1_instructions() {
    for kind in [Kind::Ax, Kind::Sts, Kind::Scs] {
        let wire = wire(Protocol1::new(kind, &[(3, 300), (253, 400)]), None, line(false));
        let mut client =
            protocol1::Protocol1Client::<_, _, _, 192>::new(port(&wire, line(false)) as Port2<Protocol1>);
        let (torque, goal) = if kind == Kind::Ax { (24, 30) } else { (40, 42) };
        assert_eq!(wire.run(client.ping(3)).0, Ok(0));
        assert_eq!(wire.run(client.ping(4)).0, Err(BusError::NoReply));
        assert_eq!(wire.run(client.write(3, torque, &[1])).0, Ok(0));
        assert_eq!(wire.run(client.write(protocol1::packet::BROADCAST_ID, torque, &[1])).0, Ok(0));
        assert!(wire.servos(|bus| bus.servos.iter().all(servos1::Servo::torque)));
        let bytes = if kind == Kind::Scs { 321_u16.to_be_bytes() } else { 321_u16.to_le_bytes() };
        wire.run(client.sync_write(goal, [(3, bytes), (253, bytes)])).0.unwrap();
        assert!(wire.servos(|bus| bus.servos.iter().all(|servo| servo.goals == [321])));
        let mut data = [0; 2];
        assert_eq!(wire.run(client.read(253, goal, &mut data)).0, Ok(0));
        assert_eq!(data, bytes);
        assert_eq!(wire.servos(|bus| bus.complaints.clone()), [""; 0]);
        // A servo that is in trouble says so in each answer; only AX and MX refuse by it.
        wire.servos(|bus| bus.servos[0].state = 0x20);
        assert_eq!(wire.run(client.ping(3)).0, Ok(0x20));
        let result = wire.run(client.write(3, 30, &[1])).0;
        assert_eq!(result, Ok(if kind == Kind::Ax { 0x28 } else { 0x20 }));
    }
}

#[test]
fn an_echo_that_nobody_told_of_is_no_answer() {
    // The line echoes, the port does not expect it, and there is no servo.
    let echoing = LineConfig { echo: true, ..LineConfig::uart(BAUD) };
    let wire = wire(Protocol1::new(Kind::Ax, &[]), None, echoing);
    let mut client =
        protocol1::Protocol1Client::<_, _, _, 192>::new(port(&wire, line(false)) as Port2<Protocol1>);
    for len in 1..20 {
        let result = wire.run(client.read(1, 36, &mut vec![0; len])).0;
        assert_eq!(result, Err(BusError::Corrupt), "a read of {len} bytes");
    }
    assert_eq!(wire.run(client.write(1, 24, &[1])).0, Err(BusError::Corrupt));
    // The one that cannot be told: see the client's documentation.
    assert_eq!(wire.run(client.ping(1)).0, Ok(1));
}

/// A blocking port: the strict servos behind a queue, without time.
struct Loop<'s> {
    servos: &'s RefCell<XSeries>,
    queue: VecDeque<u8>,
}

impl embedded_io::ErrorType for Loop<'_> {
    type Error = embedded_io::ErrorKind;
}

impl embedded_io::Write for Loop<'_> {
    fn write(&mut self, buf: &[u8]) -> Result<usize, Self::Error> {
        let answers = crate::wire::Servos::hear(&mut *self.servos.borrow_mut(), buf, 0);
        self.queue.extend(answers.into_iter().flat_map(|(_, answer)| answer));
        Ok(buf.len())
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

impl embedded_io::ReadReady for Loop<'_> {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(!self.queue.is_empty())
    }
}

impl embedded_io::Read for Loop<'_> {
    fn read(&mut self, buf: &mut [u8]) -> Result<usize, Self::Error> {
        assert!(!self.queue.is_empty(), "this read would block for ever");
        let count = buf.len().min(self.queue.len());
        for (slot, byte) in buf.iter_mut().zip(self.queue.drain(..count)) {
            *slot = byte;
        }
        Ok(count)
    }
}

struct Slept<'s>(&'s RefCell<u64>);

impl embedded_hal::delay::DelayNs for Slept<'_> {
    fn delay_ns(&mut self, ns: u32) {
        *self.0.borrow_mut() += u64::from(ns);
    }
}

#[test]
fn blocking_code_is_served_by_the_same_client() {
    let (servos, slept) = (RefCell::new(XSeries::new(&IDS)), RefCell::new(0));
    let uart = Polled(Loop { servos: &servos, queue: VecDeque::new() });
    let port = Port::new(uart, Automatic, PolledDelay::new(Slept(&slept)), LineConfig::uart(BAUD));
    let mut bus = DynamixelBus::<_, _, _, 640>::new(DynamixelClient::new(port));
    for index in 0..IDS.len() {
        block_on(bus.ping(&IDS, index)).unwrap();
    }
    let mut readings = [None; 5];
    block_on(bus.read_all(&IDS, &mut readings)).unwrap();
    assert_eq!(readings.map(|reading| reading.unwrap().position), IDS.map(position));
    *slept.borrow_mut() = 0;
    assert_eq!(block_on(bus.client().ping(99)), Err(BusError::NoReply));
    // 15 bytes and the slack.
    assert_eq!(*slept.borrow(), 451_000);
    assert_eq!(block_on(bus.client().ping(7)).map(|ping| ping.model), Ok(1020));
}
