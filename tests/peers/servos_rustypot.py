"""rustypot, the Rust client behind Reachy and LeRobot, against `bunraku servos`.

Usage: servos_rustypot.py PORT, with servos 1, 2, 3 and 20 whose torque is off.
"""

import fcntl
import math
import os
import struct
import subprocess
import sys
import time

from rustypot import Bus, Xl430PyController

IDS = [1, 2, 3, 20]
# On Linux: is the port taken exclusively?
TIOCGEXCL = 0x80045440
checks = 0


def check(found, expected, what):
    global checks
    checks += 1
    assert found == expected, f"{what}: found {found}, expected {expected}"


def one(value):
    return value[0] if isinstance(value, list) else value


def wait_until(reached, what):
    end = time.monotonic() + 20
    while not reached():
        assert time.monotonic() < end, f"{what} did not happen"


def fails(action, what):
    global checks
    checks += 1
    try:
        action()
    except (RuntimeError, OSError):
        return
    raise AssertionError(f"{what} did not fail")


def controller():
    c = Xl430PyController(sys.argv[1], 1_000_000, 0.5)
    for servo in IDS:
        check(c.ping(servo), True, f"ping {servo}")
        check(one(c.read_model_number(servo)), 1020, "model number")
    check(c.scan(IDS), {servo: 1020 for servo in IDS}, "scan")
    check(c.broadcast_scan(IDS + [99]), {servo: 1020 for servo in IDS}, "broadcast scan")
    readable = 0
    for register in Xl430PyController.registers():
        # XL430 and XM430 differ in these; the XM430-W350 of 2024 has no backup and no startup configuration.
        if register.name in ("backup_ready", "startup_configuration"):
            continue
        value, error = c.read_register_with_error(1, register.name)
        check(error, 0, f"error of reading {register.name}")
        readable += 1
    assert readable > 50, f"rustypot knows only {readable} registers"

    c.write_torque_enable(1, 1)
    c.write_profile_velocity(1, 0)
    check(c.write_register_with_error(1, "goal_position", 5000), 6, "goal beyond the limit")
    check(c.write_register_with_error(1, "temperature_limit", 70), 7, "EEPROM under torque")
    check(c.write_register_with_error(1, "led", 9), 4, "LED out of range")
    fails(lambda: c.read_led(99), "reading a servo that is not there")

    c.sync_write_torque_enable(IDS, [1] * len(IDS))
    check(c.sync_read_torque_enable(IDS), [1] * len(IDS), "sync read of torque")
    goals = [1200, 1700, 2200, 2700]
    c.sync_write_goal_position(IDS, goals)
    wait_until(lambda: c.sync_read_present_position(IDS) == goals, "the sync-written goals")
    raw = c.sync_read_raw_data(list(reversed(IDS)), 132, 4)
    check([int.from_bytes(bytes(value), "little") for value in raw], goals[::-1], "raw sync read in reverse order")

    # FF FF FD FF, a header inside a value.
    c.sync_write_torque_enable(IDS, [0] * len(IDS))
    for servo in IDS:
        c.write_operating_mode(servo, 4)
        c.write_torque_enable(servo, 1)
    c.sync_write_raw_data(IDS, 116, [list((-131073).to_bytes(4, "little", signed=True))] * len(IDS))
    check([int.from_bytes(bytes(raw), "little", signed=True) for raw in c.sync_read_raw_data(IDS, 116, 4)],
          [-131073] * len(IDS), "sync read of a value with a header in it")
    check(c.write_raw_data_with_error(1, 226, [0xFF, 0xFF, 0xFD, 0xFD, 0xFF]), 0, "writing a header")
    check(list(c.read_raw_data(1, 226, 5)), [0xFF, 0xFF, 0xFD, 0xFD, 0xFF], "raw data with a header in it")
    for servo in IDS:
        check(c.reboot(servo), True, "reboot")
        check(one(c.read_torque_enable(servo)), 0, "torque after a reboot")
        check(0 <= one(c.read_present_position(servo)) < 4096, True, "position after a reboot")
        c.write_operating_mode(servo, 3)
    c.close()


def bus():
    motors = {servo: Xl430PyController.definition() for servo in IDS}
    with Bus(sys.argv[1], 1_000_000, 0.5, motors) as b:
        check(b.set_torque(IDS, True), {}, "torque on")
        b.sync_write_register(IDS, "goal_position", [2048] * len(IDS))
        wait_until(lambda: b.sync_read_register(IDS, "present_position") == [2048] * len(IDS), "the goals of the bus")
        check(b.sync_read_register_with_error(IDS, "led"), [(0, 0)] * len(IDS), "sync read with error")
        check(b.set_torque(IDS, False), {}, "torque off")


def crashed_client():
    """rustypot takes the port for itself; a client that dies without letting go must not lock out the next one."""
    crash = (
        "import os, sys; from rustypot import Xl430PyController;"
        "c = Xl430PyController(sys.argv[1], 1_000_000, 0.5); c.ping(1); os._exit(7)"
    )
    check(subprocess.run([sys.executable, "-c", crash, sys.argv[1]]).returncode, 7, "the client that dies")
    fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
    taken = struct.unpack("i", fcntl.ioctl(fd, TIOCGEXCL, struct.pack("i", -1)))[0]
    os.close(fd)
    check(taken, 0, "exclusive use of the port after a crash")


controller()
bus()
if sys.platform == "linux":
    crashed_client()
print(f"rustypot: {checks} checks passed")
