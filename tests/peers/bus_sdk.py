"""Holds exchanges of the firmware's bus clients against ROBOTIS' dynamixel-sdk.

Takes on stdin a JSON list of exchanges: protocol, method of the SDK, its arguments, the bytes that our client sent, those
that the simulated servos answered, and what is to be read out of them (null: compare bytes only, or each servo's data).
"""

import json
import sys

import dynamixel_sdk as dxl


class Port:
    """A port that keeps what is written and gives out what it was given; time is over when that is all."""

    def __init__(self, answer):
        self.is_using, self.written, self.answer, self.baudrate = False, [], bytes(answer), 1_000_000

    def clearPort(self):
        pass

    def getBaudRate(self):
        return self.baudrate

    def writePort(self, packet):
        self.written += packet
        return len(packet)

    def readPort(self, length):
        taken, self.answer = self.answer[:length], self.answer[length:]
        return list(taken)

    def getBytesAvailable(self):
        return len(self.answer)

    def setPacketTimeout(self, length):
        pass

    setPacketTimeoutMillis = setPacketTimeout

    def isPacketTimeout(self):
        return not self.answer


def group(port, handler, method, arguments):
    """A read of many: returns each servo's data, in order."""
    sync = "Sync" in method or method.startswith("sync")
    if sync:
        address, length, ids = arguments
        items = [(servo, address, length) for servo in ids]
        reader = dxl.GroupSyncRead(port, handler, address, length)
        for servo in ids:
            reader.addParam(servo)
    else:
        items = arguments
        reader = dxl.GroupBulkRead(port, handler)
        for item in items:
            reader.addParam(*item)
    fast = {True: "fastSyncRead", False: "fastBulkRead"}[sync]
    result = getattr(reader, fast)() if method.startswith("fast") else reader.txRxPacket()
    assert result == dxl.COMM_SUCCESS, handler.getTxRxResult(result)
    return [reader.getData(*item) for item in items]


def expected_of_group(exchange):
    """What the simulated servos hold: by their construction, not out of the answer."""
    if exchange["method"] in ("syncRead", "fastSyncRead"):
        # Servos 1 and 7 have a goal and torque and have gone there.
        return [3000 if servo in (1, 7) else 1000 * servo + 500 for servo in exchange["arguments"][2]]
    return [3000, 1]


exchanges = json.load(sys.stdin)
for exchange in exchanges:
    port = Port(exchange["answered"])
    handler = dxl.PacketHandler(float(exchange["protocol"]))
    method, arguments = exchange["method"], exchange["arguments"]
    if method in ("syncRead", "fastSyncRead", "bulkRead", "fastBulkRead"):
        found, expected = group(port, handler, method, arguments), expected_of_group(exchange)
    else:
        result = getattr(handler, method)(port, *arguments)
        result = result if isinstance(result, tuple) else (result,)
        expected = exchange["read"]
        if method == "ping":
            model, result = result[0], result[1]
            found = model if result == dxl.COMM_SUCCESS else None
        elif method == "readTxRx":
            data, result, error = result
            assert (result, error) == (dxl.COMM_SUCCESS, 0), (exchange, result, error)
            found = list(data)
        else:
            assert result[0] == dxl.COMM_SUCCESS and sum(result) == 0, (exchange, result)
            found = []
    assert port.written == exchange["sent"], f"{method}: the SDK sends {port.written}, we {exchange['sent']}"
    assert found == expected, f"{method}: the SDK reads {found}, expected {expected}"
print(f"{len(exchanges)} exchanges are the same")
