"""A second client of the link, written from docs/LINK.md alone: keys, two sessions, pause, seek, sync and stop.

python link_session.py HOST:PORT KEYFILE CLIP.mclip OTHER.mclip

CLIP is one for the device's puppet, at least five seconds long; OTHER is one of another skeleton. Prints what it saw as JSON.
"""

import hmac
import json
import os
import socket
import sys
import time
import zlib

STATES = (
    "finding reading arming opening easing playing stopping holding returning resting limp paused letting-go".split()
)
# Numbers of requests, commands, responses and refusals.
HELLO, ALIVE, COMMAND, TELEMETRY, HOLD, CLIP, BEGIN, DATA, COMMIT, ABANDON, REMOVE = range(11)
PROVE, FACTS, DEMANDS = 14, 15, 16
PLAY, QUEUE, PAUSE, RESUME, SPEED, SEEK, SYNC, STOP, HOME = range(9)
R_HELLO, R_DONE, R_AGAIN, R_REFUSED, R_UPLOAD, R_CLIP, R_STREAM, R_CHALLENGE, R_FACTS, R_DEMANDS = range(10)


def varint(value):
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes(out + bytes([value]))


def sized(data):
    return varint(len(data)) + data


def cobs(data):
    out = bytearray()
    for run in data.split(b"\0"):
        while len(run) >= 254:
            out += b"\xff" + run[:254]
            run = run[254:]
        out += bytes([len(run) + 1]) + run
    return bytes(out)


def uncobs(data):
    out = bytearray()
    while data:
        code = data[0]
        if len(data) < code:
            return None
        out += data[1:code]
        data = data[code:]
        if code < 255 and data:
            out.append(0)
    return bytes(out)


class Reader:
    def __init__(self, data):
        self.data, self.at = data, 0

    def u8(self):
        self.at += 1
        return self.data[self.at - 1]

    def number(self):
        value = shift = 0
        while True:
            byte = self.u8()
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def signed(self):
        value = self.number()
        return value >> 1 ^ -(value & 1)

    def sized(self):
        length = self.number()
        self.at += length
        return self.data[self.at - length : self.at]

    def option(self, read):
        return read() if self.u8() else None

    def rest(self):
        return self.data[self.at :]


class Refused(Exception):
    """The bytes of the refusal, as the page's table has them."""


class Client:
    def __init__(self, address, key=None):
        host, port = address.rsplit(":", 1)
        self.line = socket.create_connection((host, int(port)), 5)
        self.line.sendall(b"\0")
        self.buffer, self.number, self.key, self.events = b"", 0, key, []

    def frames(self, until):
        while True:
            frame, zero, rest = self.buffer.partition(b"\0")
            if zero:
                self.buffer = rest
                data = uncobs(frame)
                if data and len(data) > 4 and zlib.crc32(data[:-4]).to_bytes(4, "little") == data[-4:]:
                    reader = Reader(data[:-4])
                    yield reader.number(), reader
                continue
            left = until - time.monotonic()
            if left <= 0:
                return
            self.line.settimeout(left)
            try:
                more = self.line.recv(4096)
            except TimeoutError:
                return
            if not more:
                raise EOFError("the device has closed the connection")
            self.buffer += more

    def request(self, number, fields=b""):
        self.number += 1
        body = varint(self.number & 0xFFFF) + varint(number) + fields
        frame = cobs(body + zlib.crc32(body).to_bytes(4, "little")) + b"\0"
        for _ in range(10):
            self.line.sendall(frame)
            for answered, reader in self.frames(time.monotonic() + 0.3):
                if reader.u8() == 1:
                    self.events.append(telemetry(reader))
                elif answered == self.number & 0xFFFF:
                    response = reader.number()
                    if response == R_REFUSED:
                        raise Refused(reader.rest().hex(" "))
                    return response, reader
        raise SystemExit(f"no answer to request {number}")

    def done(self, number, fields=b""):
        while True:
            response, reader = self.request(number, fields)
            if response != R_AGAIN:
                assert response == R_DONE, response
                return reader

    def wanted(self, number, fields):
        while True:
            response, reader = self.request(number, fields)
            if response != R_AGAIN:
                assert response == R_UPLOAD, response
                return reader.number()

    def command(self, number, fields=b""):
        self.done(COMMAND, varint(number) + fields)

    def hello(self):
        session = int.from_bytes(os.urandom(4), "little")
        response, reader = self.request(HELLO, bytes([1]) + varint(session))
        if response == R_CHALLENGE:
            nonce = reader.sized()
            message = b"bunraku link 1 proof" + nonce + session.to_bytes(4, "little")
            response, reader = self.request(PROVE, sized(hmac.digest(self.key, message, "sha256")))
        assert response == R_HELLO, response
        assert reader.u8() == 1
        found = {"firmware": reader.sized().decode(), "name": reader.sized().decode(), "servos": reader.u8()}
        keys = ("tick_hz", "clock_hz", "data_bytes", "clip_bytes")
        found.update((key, reader.number()) for key in keys)
        return found

    def begin(self, clip, data):
        return self.wanted(BEGIN, varint(clip) + sized(b"peer") + varint(len(data)) + varint(zlib.crc32(data)))

    def upload(self, clip, data, most):
        at = self.begin(clip, data)
        while at < len(data):
            at = self.wanted(DATA, varint(at) + sized(data[at : at + most]))
        self.done(COMMIT)

    def status(self):
        """Telemetry of now."""
        self.done(TELEMETRY, varint(65535))
        self.events.clear()
        until = time.monotonic() + 3
        while not self.events and time.monotonic() < until:
            for _, reader in self.frames(time.monotonic() + 0.1):
                if reader.u8() == 1:
                    self.events.append(telemetry(reader))
        self.done(TELEMETRY, varint(0))
        return self.events[-1]

    def until(self, state, seconds=30):
        limit = time.monotonic() + seconds
        while time.monotonic() < limit:
            told = self.status()
            if told["state"] == state:
                return told
        raise SystemExit(f"the puppet is never {state}: {told}")


def refused(call, *arguments):
    """The bytes of what is refused."""
    try:
        call(*arguments)
    except Refused as refusal:
        return str(refusal)
    raise SystemExit(f"{arguments} is not refused")


def telemetry(reader):
    assert reader.number() == 0
    found = {"heard": time.monotonic(), "millis": reader.number(), "state": STATES[reader.number()]}
    fault = reader.u8()
    assert fault == 0, "a fault, which this client does not read"
    found["playing"] = reader.option(lambda: [reader.number(), reader.number(), reader.number()])
    found["speed"] = reader.number()
    return found


def names_digest(names):
    return zlib.crc32("".join(name + "\n" for name in names).encode())


def main():
    address, key = sys.argv[1], open(sys.argv[2], "rb").read().rstrip(b"\r\n")
    clip, other = (open(path, "rb").read() for path in sys.argv[3:5])
    seen = {}

    stranger = Client(address, b"0123456789abcdef not this one")
    seen["wrong key"] = refused(stranger.hello)
    seen["no session"] = refused(stranger.command, STOP)
    stranger.line.close()

    first, second = Client(address, key), Client(address, key)
    device = first.hello()
    second.hello()
    tick, most = 1 / device["tick_hz"], device["data_bytes"]

    # An upload is its session's.
    at = first.begin(1, clip)
    at = first.wanted(DATA, varint(at) + sized(clip[:most]))
    seen["busy"] = refused(second.begin, 1, clip)
    seen["busy to remove"] = refused(second.done, REMOVE, varint(1))
    first.upload(1, clip, most)
    seen["other names"] = refused(second.upload, 2, other, most)

    response, reader = first.request(FACTS, varint(1))
    assert response == R_FACTS and reader.u8() == 1
    seen["frames"], seen["channels"] = reader.number(), reader.number()
    rate, seen["names"] = reader.number() / 100, reader.option(reader.number)
    response, reader = second.request(DEMANDS)
    assert response == R_DEMANDS
    seen["demands"] = [reader.number(), reader.number()]

    seen["nothing plays"] = refused(second.command, PAUSE)
    seen["no clip"] = refused(second.command, QUEUE, varint(9) + b"\0")
    first.command(PLAY, varint(1) + b"\1")
    first.until("playing")

    # What one pauses, the other sees, and a stop ends it.
    second.command(PAUSE)
    time.sleep(0.4)
    stands = first.status()
    again = second.status()
    seen["paused"] = [stands["state"], stands["speed"], stands["playing"] == again["playing"]]
    seen["beyond"] = refused(first.command, SEEK, varint(seen["frames"]))
    first.command(STOP)
    seen["stopped"] = first.until("holding")["playing"]

    first.command(PLAY, varint(1) + b"\1")
    first.until("playing")

    def position():
        """Frame of the clip, and when that was, by this computer's clock: telemetry is sent in the tick that it tells."""
        told = first.status()
        _, frame, phase = told["playing"]
        return frame + phase / 65536, told["heard"]

    # A clock that is a second and a half ahead of the clip.
    frame, when = position()
    ahead = frame + 1.5 * rate

    def outside(now):
        return (ahead + (now - when) * rate) % seen["frames"]

    offs = []
    for _ in range(2):
        # Right after a response the next request waits for a tick.
        first.done(ALIVE)
        at = outside(time.monotonic() + tick)
        first.command(SYNC, varint(int(at)) + varint(int(at % 1 * 65536)))
        # The way to the frame, eight frames a tick, and the fade.
        time.sleep(2.5)
        frame, now = position()
        off = (frame - outside(now) + seen["frames"] / 2) % seen["frames"] - seen["frames"] / 2
        offs.append(off / rate * 1000)
    seen["ms off after each sync"] = offs
    first.command(SEEK, varint(5))
    seen["sought"] = first.status()["state"]

    # All places are taken, and one more says stop.
    crowd = [Client(address, key) for _ in range(3)]
    for one in crowd[:2]:
        one.hello()
    crowd[2].hello()
    seen["full"] = refused(crowd[2].command, HOME)
    crowd[2].command(STOP)
    seen["stopped by a fifth"] = first.until("holding")["state"]
    print(json.dumps(seen))


main()
