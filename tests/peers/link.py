"""A client of the link, written from docs/LINK.md alone: uploads a clip, plays it, and says what the device told.

python link.py HOST:PORT CLIP.mclip
"""

import json
import socket
import sys
import time
import zlib


def varint(value):
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def slice_of(data):
    return varint(len(data)) + data


def cobs(data):
    out = bytearray()
    run = bytearray()
    for byte in data:
        if byte:
            run.append(byte)
            if len(run) == 254:
                out += b"\xff" + run
                run.clear()
        else:
            out += bytes([len(run) + 1]) + run
            run.clear()
    return bytes(out + bytes([len(run) + 1]) + run)


def uncobs(data):
    out = bytearray()
    while data:
        code = data[0]
        if code == 0 or len(data) < code:
            return None
        out += data[1:code]
        data = data[code:]
        if code < 255 and data:
            out.append(0)
    return bytes(out)


class Reader:
    def __init__(self, data):
        self.data = data
        self.at = 0

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

    def text(self):
        length = self.number()
        self.at += length
        return self.data[self.at - length : self.at].decode()

    def option(self, read):
        return read() if self.u8() else None


def hello(r):
    keys = "version firmware name servos tick_hz clock_hz data_bytes clip_bytes".split()
    reads = [r.u8, r.text, r.text, r.u8, r.number, r.number, r.number, r.number]
    found = {key: read() for key, read in zip(keys, reads)}
    found["flash_stalls"] = bool(r.u8())
    return found


def clip(r):
    found = {"clip": r.number(), "name": r.text(), "bytes": r.number(), "crc": r.number()}
    found["built_in"] = bool(r.u8())
    return found


def reading(r):
    return {
        "position": r.signed(),
        "celsius": r.option(r.u8),
        "millivolts": r.option(r.number),
        "load": r.option(r.signed),
        "errors": r.u8(),
        "torque": r.option(r.u8),
    }


def servo(r):
    return {"id": r.u8(), "goal": r.signed(), "reading": r.option(lambda: reading(r))}


def no_fault():
    raise SystemExit("the device has a fault, which this client does not read")


def telemetry(r):
    assert r.number() == 0, "an event that the document does not have"
    found = {"millis": r.number(), "state": r.number(), "fault": r.option(no_fault)}
    found["playing"] = r.option(lambda: [r.number(), r.number(), r.number()])
    for key in "speed ticks missed busy busiest".split():
        found[key] = r.number()
    found["bus"] = r.option(no_fault)
    found["stream"] = r.option(lambda: [r.number() for _ in range(13)])
    for key in "damaged repeated unknown dropped".split():
        found[key] = r.number()
    found["servos"] = [servo(r) for _ in range(r.number())]
    assert r.at == len(r.data), "bytes behind the telemetry"
    return found


class Client:
    def __init__(self, address):
        host, port = address.rsplit(":", 1)
        self.line = socket.create_connection((host, int(port)), 5)
        self.line.sendall(b"\0")
        self.buffer = b""
        self.sequence = 0
        self.events = []

    def answers(self, until):
        while True:
            frame, zero, rest = self.buffer.partition(b"\0")
            if zero:
                self.buffer = rest
                data = uncobs(frame)
                if data and len(data) > 4 and zlib.crc32(data[:-4]).to_bytes(4, "little") == data[-4:]:
                    r = Reader(data[:-4])
                    yield r.number(), r
                continue
            left = until - time.monotonic()
            if left <= 0:
                return
            self.line.settimeout(left)
            try:
                self.buffer += self.line.recv(4096)
            except TimeoutError:
                return

    def request(self, number, fields=b""):
        """The response's number, and what follows it."""
        self.sequence += 1
        body = varint(self.sequence) + varint(number) + fields
        frame = cobs(body + zlib.crc32(body).to_bytes(4, "little")) + b"\0"
        for _ in range(10):
            # Twice, as a line might: it is done once.
            self.line.sendall(frame + frame)
            for sequence, r in self.answers(time.monotonic() + 0.3):
                if r.u8() == 1:
                    self.events.append(telemetry(r))
                elif sequence == self.sequence:
                    return r.number(), r
        raise SystemExit(f"no answer to request {number}")

    def job(self, number, fields, expected):
        while True:
            response, r = self.request(number, fields)
            if response == expected:
                return r
            if response != 2:
                raise SystemExit(f"request {number} is answered with {response}: {r.data.hex()}")


def main():
    client = Client(sys.argv[1])
    data = open(sys.argv[2], "rb").read()
    device = hello(client.job(0, bytes([1]) + varint(0xC0FFEE), 0))
    begin = varint(7) + slice_of(b"peer") + varint(len(data)) + varint(zlib.crc32(data))
    wanted = client.job(6, begin, 4).number()
    while wanted < len(data):
        part = data[wanted : wanted + device["data_bytes"]]
        wanted = client.job(7, varint(wanted) + slice_of(part), 4).number()
    client.job(8, b"", 1)
    clips = []
    while True:
        r = client.job(5, varint(len(clips)), 5)
        found = r.option(lambda: clip(r))
        if found is None:
            break
        clips.append(found)
    client.job(3, varint(50), 1)
    client.job(2, varint(0) + varint(7) + b"\0", 1)
    frames = 0
    until = time.monotonic() + 20
    while frames < 100 and time.monotonic() < until:
        for _, r in client.answers(time.monotonic() + 0.2):
            if r.u8() == 1:
                client.events.append(telemetry(r))
        frames = max([event["playing"][1] for event in client.events if event["playing"]], default=0)
    client.job(2, varint(7), 1)
    last = client.events[-1]
    print(json.dumps({"device": device, "clips": clips, "frames": frames, "last": last}))


main()
