"""ROBOTIS' own dynamixel-sdk against `bunraku servos`.

Usage: servos_sdk.py PORT, with servos 1, 2, 3 and 20 in the state of the factory, 3 limited to positions 1000 to 3000.
"""

import os
import sys
import time

import dynamixel_easy_sdk
import dynamixel_sdk as dxl
import dynamixel_sdk.port_handler

# The SDK gives up after 34 ms, which a busy machine can need; how long answers took is printed instead.
dynamixel_sdk.port_handler.LATENCY_TIMER = 250

IDS = [1, 2, 3, 20]
MODEL, FIRMWARE = 1020, 46
FAIL, INSTRUCTION, CRC, RANGE, LENGTH, LIMIT, ACCESS, ALERT = 1, 2, 3, 4, 5, 6, 7, 0x80

TEMPERATURE_LIMIT, OPERATING_MODE, HOMING_OFFSET = 31, 11, 20
MAX_VOLTAGE_LIMIT, MAX_POSITION_LIMIT = 32, 48
TORQUE, LED, RETURN_LEVEL, REGISTERED, HARDWARE_ERROR = 64, 65, 68, 69, 70
PROFILE_ACCELERATION, PROFILE_VELOCITY, GOAL, MOVING = 108, 112, 116, 122
VELOCITY, POSITION, VOLTAGE, TEMPERATURE = 128, 132, 144, 146
INDIRECT_ADDRESS, INDIRECT_DATA = 168, 224

port = dxl.PortHandler(sys.argv[1])
packet = dxl.PacketHandler(2.0)
checks = 0


def check(found, expected, what):
    global checks
    checks += 1
    assert found == expected, f"{what}: found {found}, expected {expected}"


def le(value, length):
    return list((value & (1 << 8 * length) - 1).to_bytes(length, "little"))


def signed(value):
    return value - (1 << 32) if value & 1 << 31 else value


def read(servo, address, length):
    data, result, error = packet.readTxRx(port, servo, address, length)
    check((result, error), (dxl.COMM_SUCCESS, 0), f"read {address} of {servo}")
    return int.from_bytes(bytes(data), "little")


def write(servo, address, length, value, error=0):
    result = packet.writeTxRx(port, servo, address, length, le(value, length))
    check(result, (dxl.COMM_SUCCESS, error), f"write {value} to {address} of {servo}")


def wait_until(reached, what):
    """Polls; that counts as one check."""
    global checks
    before, end = checks, time.monotonic() + 20
    while not reached():
        assert time.monotonic() < end, f"{what} did not happen"
    checks = before + 1


def ping():
    for servo in IDS:
        check(packet.ping(port, servo), (MODEL, dxl.COMM_SUCCESS, 0), f"ping {servo}")
    check(packet.ping(port, 99)[1], dxl.COMM_RX_TIMEOUT, "ping a servo that is not there")
    found, result = packet.broadcastPing(port)
    check(result, dxl.COMM_SUCCESS, "broadcast ping")
    check(found, {servo: [MODEL, FIRMWARE] for servo in IDS}, "broadcast ping")
    check(list(found), sorted(found), "order of the broadcast ping")


def control_table():
    """Every item that ROBOTIS lists for this model can be read at its address and length, with the factory's value."""
    folder = os.path.dirname(dynamixel_easy_sdk.__file__)
    with open(os.path.join(folder, "control_table", "xm430_w350.model")) as file:
        lines = file.read().split("[control table]")[1].splitlines()
    items = [line.split("\t") for line in lines if line and line[0].isdigit()]
    assert len(items) >= 54, f"only {len(items)} items in ROBOTIS' model file"
    factory = {
        "Model Number": MODEL, "ID": 2, "Baud Rate": 1, "Return Delay Time": 250, "Operating Mode": 3,
        "Secondary(Shadow) ID": 255, "Protocol Type": 2, "Moving Threshold": 10, "Temperature Limit": 80,
        "Max Voltage Limit": 160, "Min Voltage Limit": 95, "PWM Limit": 885, "Current Limit": 1193,
        "Velocity Limit": 200, "Max Position Limit": 4095, "Min Position Limit": 0, "Shutdown": 52,
        "Torque Enable": 0, "Status Return Level": 2, "Velocity I Gain": 1920, "Velocity P Gain": 100,
        "Position P Gain": 800, "Bus Watchdog": 0, "Profile Velocity": 0, "Indirect Address 1": 224,
    }
    for address, length, name in items:
        value = read(2, int(address), int(length))
        check(value, factory.pop(name, value), name)
    check(factory, {}, "items that ROBOTIS' model file lacks")


def refusals():
    write(1, 0, 2, 5, ACCESS)
    write(1, POSITION, 4, 5, ACCESS)
    write(1, 66, 1, 5, ACCESS)
    write(1, LED, 1, 2, RANGE)
    write(1, GOAL, 2, 5, LENGTH)
    write(1, GOAL, 4, 4096, LIMIT)
    write(3, GOAL, 4, 999, LIMIT)
    write(3, GOAL, 4, 3001, LIMIT)
    write(3, GOAL, 4, 3000)
    check(packet.readTxRx(port, 1, 662, 1)[2], ACCESS, "read beyond the table")
    write(1, TORQUE, 1, 1)
    write(1, MAX_POSITION_LIMIT, 4, 3000, ACCESS)
    write(1, TORQUE, 1, 0)
    write(1, MAX_POSITION_LIMIT, 4, 4000)
    write(1, MAX_POSITION_LIMIT, 4, 4095)
    # A ping whose checksum is wrong, behind noise and half a header.
    port.ser.write(bytes([0x12, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x00, 0x00]))
    port.setPacketTimeout(11)
    answer, result = packet.rxPacket(port, False)
    check((result, answer[8]), (dxl.COMM_SUCCESS, CRC), "wrong checksum")


def motion():
    write(1, TORQUE, 1, 1)
    write(1, PROFILE_VELOCITY, 4, 100)
    write(1, PROFILE_ACCELERATION, 4, 20)
    write(1, GOAL, 4, 3000)
    seen = []
    wait_until(lambda: seen.append(read(1, POSITION, 4)) or read(1, MOVING, 1) == 0, "the end of the move")
    check(read(1, POSITION, 4), 3000, "present position")
    check(seen, sorted(seen), "positions on the way up")
    assert 2048 < seen[len(seen) // 2] < 3000, f"no position between start and goal in {seen}"
    check(read(1, VELOCITY, 4), 0, "present velocity")
    write(1, TORQUE, 1, 0)


def sync():
    group = dxl.GroupSyncWrite(port, packet, GOAL, 4)
    goals = {servo: 1000 + 10 * servo for servo in IDS}
    for servo, goal in goals.items():
        write(servo, TORQUE, 1, 1)
        group.addParam(servo, le(goal, 4))
    check(group.txPacket(), dxl.COMM_SUCCESS, "sync write")
    wait_until(lambda: not any(read(servo, MOVING, 1) for servo in IDS), "the end of the sync-written moves")
    for fast in (False, True):
        group = dxl.GroupSyncRead(port, packet, VELOCITY, 8)
        for servo in reversed(IDS):
            group.addParam(servo)
        check(group.fastSyncRead() if fast else group.txRxPacket(), dxl.COMM_SUCCESS, f"sync read, fast: {fast}")
        for servo in IDS:
            check(group.getData(servo, POSITION, 4), goals[servo], f"sync read of {servo}, fast: {fast}")
            check(group.getData(servo, VELOCITY, 4), 0, f"sync read of {servo}, fast: {fast}")
        group.addParam(99)
        failed = [dxl.COMM_RX_TIMEOUT, dxl.COMM_RX_CORRUPT]
        if not fast:
            assert group.txRxPacket() in failed, "a sync read with a missing servo did not time out"


def bulk():
    group = dxl.GroupBulkWrite(port, packet)
    group.addParam(1, LED, 1, [1])
    group.addParam(2, GOAL, 4, le(1500, 4))
    check(group.txPacket(), dxl.COMM_SUCCESS, "bulk write")
    wait_until(lambda: read(2, MOVING, 1) == 0, "the end of the bulk-written move")
    for fast in (False, True):
        group = dxl.GroupBulkRead(port, packet)
        group.addParam(2, POSITION, 4)
        group.addParam(1, LED, 1)
        group.addParam(20, VOLTAGE, 2)
        check(group.fastBulkRead() if fast else group.txRxPacket(), dxl.COMM_SUCCESS, f"bulk read, fast: {fast}")
        values = [group.getData(2, POSITION, 4), group.getData(1, LED, 1), group.getData(20, VOLTAGE, 2)]
        check(values, [1500, 1, 120], f"bulk read, fast: {fast}")


def registered():
    check(packet.regWriteTxRx(port, 1, LED, 1, [0]), (dxl.COMM_SUCCESS, 0), "reg write")
    check((read(1, REGISTERED, 1), read(1, LED, 1)), (1, 1), "before action")
    check(packet.action(port, 1), dxl.COMM_SUCCESS, "action")
    # The SDK does not wait for the answer to an action and would take it for that of the next read.
    time.sleep(0.1)
    check((read(1, REGISTERED, 1), read(1, LED, 1)), (0, 0), "after action")


def stuffing():
    """Values whose bytes imitate a header: -131073 is FF FF FD FF."""
    for servo in IDS:
        write(servo, TORQUE, 1, 0)
        write(servo, OPERATING_MODE, 1, 4)
        write(servo, TORQUE, 1, 1)
        write(servo, GOAL, 4, -131073)
        check(signed(read(servo, GOAL, 4)), -131073, "goal position with a header in it")
    for fast in (False, True):
        group = dxl.GroupSyncRead(port, packet, GOAL, 4)
        for servo in IDS:
            group.addParam(servo)
        check(group.fastSyncRead() if fast else group.txRxPacket(), dxl.COMM_SUCCESS, f"sync read, fast: {fast}")
        for servo in IDS:
            check(signed(group.getData(servo, GOAL, 4)), -131073, f"sync read of {servo}, fast: {fast}")
    # The SDK's Python client drops what its addStuffing returns and sends such values bare, so that a servo loses the
    # second FD of FF FF FD FD. They are written in halves here; reading them back goes through stuffing.
    for data in ([0xFF, 0xFF, 0xFD, 0xFD], [0xFF, 0xFF, 0xFD, 0xFD, 0xFD, 0xFF], [0xFF, 0xFF, 0xFF, 0xFD, 0x00, 0xFF]):
        for start in range(0, len(data), 2):
            write(1, INDIRECT_DATA + start, 2, data[start] | data[start + 1] << 8)
        check(read(1, INDIRECT_DATA, len(data)), int.from_bytes(bytes(data), "little"), f"indirect data {data}")
    for servo in IDS:
        write(servo, TORQUE, 1, 0)
        check(packet.clearMultiTurn(port, servo), (dxl.COMM_SUCCESS, 0), "clear")
        assert 0 <= read(servo, POSITION, 4) < 4096, "clear left more than a turn"
        write(servo, OPERATING_MODE, 1, 3)


def indirect():
    write(1, INDIRECT_ADDRESS, 2, LED)
    write(1, INDIRECT_DATA, 1, 1)
    check(read(1, LED, 1), 1, "LED by its indirect address")


def faults():
    write(2, TEMPERATURE_LIMIT, 1, 20, ALERT)
    write(2, TORQUE, 1, 1, ALERT | FAIL)
    data, result, error = packet.readTxRx(port, 2, HARDWARE_ERROR, 1)
    check((list(data), result, error), ([4], dxl.COMM_SUCCESS, ALERT), "hardware error status")
    write(2, TEMPERATURE_LIMIT, 1, 80, ALERT)
    check(packet.reboot(port, 2), (dxl.COMM_SUCCESS, 0), "reboot")
    write(2, TORQUE, 1, 1)
    write(2, TORQUE, 1, 0)
    write(2, RETURN_LEVEL, 1, 1)
    check(packet.writeTxRx(port, 2, LED, 1, [1])[0], dxl.COMM_RX_TIMEOUT, "write at status return level 1")
    check(read(2, LED, 1), 1, "LED")
    check(packet.factoryReset(port, 2, 0x01)[0], dxl.COMM_RX_TIMEOUT, "factory reset at status return level 1")
    check((read(2, RETURN_LEVEL, 1), read(2, LED, 1)), (2, 0), "after the factory reset")


def speed():
    times = []
    for _ in range(300):
        start = time.perf_counter()
        read(1, POSITION, 4)
        times.append(1000 * (time.perf_counter() - start))
    times.sort()
    return f"a read takes {times[150]:.2f} ms (median), {times[-1]:.2f} ms (longest of 300)"


assert port.openPort() and port.setBaudRate(1_000_000), f"cannot open {sys.argv[1]}"
for step in (ping, control_table, refusals, motion, sync, bulk, registered, stuffing, indirect, faults):
    step()
print(f"dynamixel-sdk: {checks} checks passed; {speed()}")
port.closePort()
