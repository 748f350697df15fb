//! ROBOTIS' own client as a second opinion: it sends the same bytes for the same instruction, and reads the same values
//! out of the strict servos' answers.

use crate::servos1::{Kind, Protocol1};
use crate::servos2::XSeries;
use crate::session::{Port2, line, port, wire};
use crate::wire::{Servos, Wire};
use bunraku_tests::{python, workspace};
use serde_json::{Value, json};
use servo_wire::dynamixel::client::{Answer, BulkItem, FactoryReset};
use servo_wire::dynamixel::{BROADCAST_ID, DynamixelClient};
use servo_wire::protocol1;
use std::io::Write;
use std::process::{Command, Stdio};

/// What went over a wire: the names and arguments of the SDK's methods, bytes of both directions, and what our client read.
struct Record<S> {
    wire: Wire<S>,
    protocol: u8,
    exchanges: Vec<Value>,
}

impl<S: Servos> Record<S> {
    fn add(&mut self, method: &str, arguments: Value, read: Value, call: impl Future) {
        let before = self.wire.packets().len();
        self.wire.run(call);
        let (mut sent, mut answered) = (Vec::new(), Vec::new());
        for (from_servo, packet) in self.wire.packets().split_off(before) {
            (if from_servo { &mut answered } else { &mut sent }).extend(packet);
        }
        self.exchanges.push(json!({
            "protocol": self.protocol, "method": method, "arguments": arguments,
            "sent": sent, "answered": answered, "read": read,
        }));
    }
}

fn protocol2() -> Vec<Value> {
    let ids = [7, 1, 252];
    let wire = wire(XSeries::new(&ids), None, line(false));
    let mut client = DynamixelClient::<_, _, _, 640>::new(port(&wire, line(false)));
    let mut record = Record { wire, protocol: 2, exchanges: Vec::new() };
    let quiet = |_: usize, _: Answer<'_>| {};
    let goal = 3000_i32.to_le_bytes();
    let present: Vec<Vec<u8>> =
        ids.iter().map(|&id| (1000 * i32::from(id) + 500).to_le_bytes().to_vec()).collect();
    record.add("ping", json!([7]), json!(1020), client.ping(7));
    record.add("ping", json!([99]), json!(null), client.ping(99));
    record.add("readTxRx", json!([7, 132, 4]), json!(present[0]), client.read(7, 132, &mut [0; 4]));
    record.add("writeTxRx", json!([1, 116, 4, goal]), json!([]), client.write(1, 116, &goal));
    record.add("writeTxOnly", json!([254, 64, 1, [1]]), json!([]), client.write(BROADCAST_ID, 64, &[1]));
    record.add("regWriteTxRx", json!([1, 65, 1, [1]]), json!([]), client.reg_write(1, 65, &[1]));
    record.add("action", json!([1]), json!([]), client.action(1));
    record.add(
        "syncWriteTxOnly",
        json!([65, 1, [7, 1, 1, 0], 4]),
        json!([]),
        client.sync_write(65, [(7, [1]), (1, [0])]),
    );
    let items = [(7, 116, &goal[..]), (1, 65, &[1])];
    let flat = json!([7, 116, 0, 4, 0, goal[0], goal[1], goal[2], goal[3], 1, 65, 0, 1, 0, 1]);
    record.add("bulkWriteTxOnly", json!([flat, 15]), json!([]), client.bulk_write(&items));
    record.add("syncRead", json!([132, 4, ids]), json!(null), client.sync_read(132, 4, &ids, quiet));
    record.add("fastSyncRead", json!([132, 4, ids]), json!(null), client.fast_sync_read(132, 4, &ids, quiet));
    let items = [(7, 116, 4), (252, 64, 2)].map(|(id, address, len)| BulkItem { id, address, len });
    record.add("bulkRead", json!([[7, 116, 4], [252, 64, 2]]), json!(null), client.bulk_read(&items, quiet));
    record.add(
        "fastBulkRead",
        json!([[7, 116, 4], [252, 64, 2]]),
        json!(null),
        client.fast_bulk_read(&items, quiet),
    );
    record.add("writeTxRx", json!([7, 64, 1, [0]]), json!([]), client.write(7, 64, &[0]));
    record.add("clearMultiTurn", json!([7]), json!([]), client.clear_turns(7));
    record.add(
        "factoryReset",
        json!([7, 2]),
        json!([]),
        client.factory_reset(7, FactoryReset::AllButIdAndBaud),
    );
    record.add("reboot", json!([252]), json!([]), client.reboot(252));
    record.exchanges
}

fn protocol1() -> Vec<Value> {
    let wire = wire(Protocol1::new(Kind::Ax, &[(3, 300), (252, 400)]), None, line(false));
    let mut client =
        protocol1::Protocol1Client::<_, _, _, 192>::new(port(&wire, line(false)) as Port2<Protocol1>);
    let mut record = Record { wire, protocol: 1, exchanges: Vec::new() };
    record.add("readTxRx", json!([3, 36, 2]), json!(300_u16.to_le_bytes()), client.read(3, 36, &mut [0; 2]));
    record.add("writeTxRx", json!([3, 24, 1, [1]]), json!([]), client.write(3, 24, &[1]));
    record.add("writeTxOnly", json!([254, 24, 1, [1]]), json!([]), client.write(254, 24, &[1]));
    let values = [(3, 100_u16.to_le_bytes()), (252, 700_u16.to_le_bytes())];
    record.add(
        "syncWriteTxOnly",
        json!([30, 2, [3, 100, 0, 252, 188, 2], 6]),
        json!([]),
        client.sync_write(30, values),
    );
    record.exchanges
}

#[test]
fn the_sdk_sends_and_reads_the_same() {
    let Some(python) = python() else { return };
    let exchanges = [protocol2(), protocol1()].concat();
    let mut peer = Command::new(python)
        .arg(workspace().join("tests/peers/bus_sdk.py"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("run the peer");
    let mut stdin = peer.stdin.take().expect("piped above");
    stdin.write_all(json!(exchanges).to_string().as_bytes()).expect("write to the peer");
    drop(stdin);
    let output = peer.wait_with_output().expect("the peer ends");
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{out}{err}");
    assert_eq!(out.trim(), format!("{} exchanges are the same", exchanges.len()));
    print!("{out}");
}
