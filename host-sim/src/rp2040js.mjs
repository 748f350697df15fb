// Runs an image for the Raspberry Pi Pico on rp2040js, with the servo bus on UART 0 and a host on UART 1.
//
// Usage: node rp2040js.mjs RP2040JS FLASH RTT SECONDS [host [HANG]]
//   RP2040JS  folder of the npm package
//   FLASH     file with the bytes from address 0x10000000 on
//   RTT       address of the control block of SEGGER's RTT, by which the image logs
//   SECONDS   simulated time after which this gives up
//   host      whether there is a host, with which bytes are exchanged every simulated millisecond
//   HANG      simulated time in ms after which the core is in an endless loop with its interrupts masked
//
// Standard output has messages: a kind (1 byte), a length (4 bytes, little-endian), that many bytes.
//   0  the image has sent these on the bus. Standard input then brings the answer: a length (4 bytes), that many bytes;
//      the length 0xffffffff ends the simulation
//   1  the image has logged these
//   2  the last one: figures, as JSON
//   3  a millisecond has gone by, in which the image has sent these to the host. The answer is as that of 0
//   4  what has happened here, as text
//
// What rp2040js 1.4.1 does not have, and what is done about it:
// - There is no boot ROM. Its functions that embassy's flash driver calls are written here, with the time that erasing and writing take (Winbond
//   W25Q16JV, typical). The second stage boot loader is not run: the core starts at the image's vectors.
// - Its UART sends in no time, raises its transmit interrupt for ever and has neither a FIFO to send nor a receive timeout, so
//   that embassy's driver never leaves the interrupt. The one below is written from the RP2040 datasheet, section 4.2.
// - All clocks are there at once, and the core runs at 125 MHz from the start.
// - Voltage regulator and ring oscillator are registers that read as ones; the flash cache's read as zeros.
// - An input that nothing drives is low, whatever pulls it up.
// - Its watchdog bites and says why, and resets nothing. With a host, the chip starts again as section 4.7 of the datasheet has it: all that
//   PSM.WDSEL names is new, which has to be all but the oscillators; RAM, REASON and the scratch registers keep what they
//   have. Only the timer goes on, which begins at zero on the chip. Without a host, that is the end.
// - SEV does nothing. Here it wakes WFE, as on the chip. Time asleep is skipped.
import { readFileSync, readSync, writeSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [folder, flash, rtt, seconds, host, hang] = process.argv.slice(2);
const index = pathToFileURL(join(folder, "dist/esm/index.js"));
const { BasePeripheral, GPIOPinState, RP2040 } = await import(index);

const VECTORS = 0x10000100;
const ROM_BYTES = 0x4000;
const CYCLE_NANOS = 8;
const UARTS = [
  { name: "UART0", address: 0x40034, interrupt: 20 },
  { name: "UART1", address: 0x40038, interrupt: 21 },
];
const XIP_CONTROL = 0x14000;
const DIRECTION_PIN = 2;
const TRIGGER_PIN = 3;
// What a servo with a return delay of 0 needs to answer. Until then the bus must have changed its direction.
const ANSWER_NANOS = 10_000;

const LOG = 1;
const FIGURES = 2;
const SENT = 0;
const HOST = 3;
const HOST_NANOS = 1e6;
const NOTE = 4;
const END = 0xffffffff;

function put(kind, bytes) {
  const message = Buffer.alloc(5 + bytes.length);
  message[0] = kind;
  message.writeUInt32LE(bytes.length, 1);
  message.set(bytes, 5);
  for (let at = 0; at < message.length; ) {
    at += writeSync(1, message, at);
  }
}

function take(length) {
  const bytes = Buffer.alloc(length);
  for (let at = 0; at < length; ) {
    const count = readSync(0, bytes, at, length - at, null);
    if (count === 0) {
      throw new Error("standard input has ended");
    }
    at += count;
  }
  return bytes;
}

let chip = new RP2040();
const { clock } = chip;
let { core } = chip;
const logger = {
  debug() {},
  // All that rp2040js does with SEV is to log it.
  info(_, message) {
    core.eventRegistered ||= message === "SEV";
  },
  // Registers that are not there.
  warn() {},
  error(name, message) {
    throw new Error(`${name}: ${message}`);
  },
};

// What the other side answers; none where it ends the simulation.
function ask(kind, bytes) {
  log();
  put(kind, bytes);
  const length = take(4).readUInt32LE(0);
  running &&= length !== END;
  return length === END ? [] : take(length);
}

// The half-duplex line to the servos.
const line = {
  packet: [],
  last: 0,
  turns: false,
  slowest: 0,
  sending() {
    return chip.gpio[DIRECTION_PIN].value === GPIOPinState.High;
  },
  sent(byte) {
    if (!this.sending()) {
      throw new Error(`byte ${byte} was on the line while the direction pin, GPIO ${DIRECTION_PIN}, was not high`);
    }
    this.packet.push(byte);
    this.last = clock.nanos;
    this.turns = true;
  },
  // Nothing more is on its way.
  idle() {
    const answer = ask(SENT, this.packet);
    this.packet = [];
    if (answer.length > 0) {
      bus.receive(answer, ANSWER_NANOS);
    }
  },
  arrives() {
    if (this.sending()) {
      throw new Error(`a servo answers while the direction pin, GPIO ${DIRECTION_PIN}, is high`);
    }
  },
  turned() {
    if (this.turns && !this.sending()) {
      this.turns = false;
      this.slowest = Math.max(this.slowest, clock.nanos - this.last);
    }
  },
};

// The line to the host.
const hostLine = {
  bytes: [],
  sent(byte) {
    this.bytes.push(byte);
  },
  idle() {},
  arrives() {},
};

// Arm's PL011 as in the RP2040: FIFOs of 32 bytes, always on; 8 data bits, no parity, no errors but overrun.
class Uart extends BasePeripheral {
  static FIFO = 32;
  static LEVELS = [4, 8, 16, 24, 28];
  static RX = 1 << 4;
  static TX = 1 << 5;
  static TIMEOUT = 1 << 6;
  static OVERRUN = 1 << 10;

  registers = { 0x24: 0, 0x28: 0, 0x2c: 0, 0x30: 0x300, 0x34: 0x12, 0x38: 0, 0x48: 0 };
  raised = 0;
  // Bytes that wait to be sent, and the one on the line.
  out = [];
  shifting = null;
  in = [];
  // Bytes that the device sends, and whether the last one that came found no room.
  coming = [];
  overrun = false;

  constructor(rp2040, { name, interrupt }, wire) {
    super(rp2040, name);
    this.interrupt = interrupt;
    this.wire = wire;
    this.shifted = clock.createAlarm(() => this.shift());
    this.arrived = clock.createAlarm(() => this.arrive());
    this.silent = clock.createAlarm(() => this.raise(Uart.TIMEOUT));
  }

  // The divider is looked at whenever a byte goes or comes.
  clkPeriChanged() {}

  bits(count) {
    const divider = this.registers[0x24] + this.registers[0x28] / 64;
    return (count * 16 * divider * 1e9) / chip.clkPeri;
  }

  level(shift) {
    return Uart.LEVELS[(this.registers[0x34] >> shift) & 7];
  }

  raise(bits) {
    this.raised |= bits;
    this.update();
  }

  update() {
    chip.setInterrupt(this.interrupt, (this.raised & this.registers[0x38]) !== 0);
  }

  // Takes the next byte to the line. The interrupt comes when the FIFO falls to its level.
  next() {
    this.shifting = this.out.shift();
    this.shifted.schedule(this.bits(10));
    if (this.out.length === this.level(0)) {
      this.raise(Uart.TX);
    }
  }

  shift() {
    this.wire.sent(this.shifting);
    this.shifting = null;
    if (this.out.length > 0) {
      this.next();
    } else {
      this.wire.idle();
    }
  }

  receive(bytes, nanos) {
    const waits = this.coming.length > 0;
    this.coming.push(...bytes);
    if (!waits) {
      this.arrived.schedule(nanos + this.bits(10));
    }
  }

  // A byte's stop bit.
  arrive() {
    this.wire.arrives();
    const byte = this.coming.shift();
    if (this.in.length < Uart.FIFO) {
      this.in.push(byte | (this.overrun ? 1 << 11 : 0));
      this.overrun = false;
    } else {
      this.overrun = true;
      this.raise(Uart.OVERRUN);
    }
    if (this.in.length >= this.level(3)) {
      this.raise(Uart.RX);
    }
    this.silent.schedule(this.bits(32));
    if (this.coming.length > 0) {
      this.arrived.schedule(this.bits(10));
    }
  }

  flags() {
    const [out, into] = [this.out.length, this.in.length];
    const full = (into === Uart.FIFO ? 1 << 6 : 0) | (out === Uart.FIFO ? 1 << 5 : 0);
    const empty = (out === 0 ? 1 << 7 : 0) | (into === 0 ? 1 << 4 : 0);
    return full | empty | (out > 0 || this.shifting !== null ? 1 << 3 : 0);
  }

  readUint32(offset) {
    switch (offset) {
      case 0x00: {
        const byte = this.in.shift() ?? 0;
        if (this.in.length < this.level(3)) {
          this.raised &= ~Uart.RX;
        }
        if (this.in.length === 0) {
          this.raised &= ~Uart.TIMEOUT;
          this.silent.cancel();
        }
        this.update();
        return byte;
      }
      case 0x04:
        return 0;
      case 0x18:
        return this.flags();
      case 0x3c:
        return this.raised;
      case 0x40:
        return this.raised & this.registers[0x38];
      case 0x44:
        return 0;
    }
    return this.registers[offset] ?? super.readUint32(offset);
  }

  writeUint32(offset, value) {
    if (offset === 0x00) {
      if (this.out.length < Uart.FIFO) {
        this.out.push(value & 0xff);
      }
      if (this.shifting === null) {
        this.next();
      }
    } else if (offset === 0x44) {
      this.raised &= ~this.rawWriteValue;
      this.update();
    } else if (offset in this.registers) {
      this.registers[offset] = value;
      this.update();
    } else if (offset !== 0x04) {
      super.writeUint32(offset, value);
    }
  }
}

let bus;
let hostUart;

// The flash cache's registers, which are not there: nothing is being read ahead.
class Idle extends BasePeripheral {
  readUint32() {
    return 0;
  }
}

const exchange = clock.createAlarm(() => {
  const bytes = ask(HOST, hostLine.bytes);
  hostLine.bytes = [];
  if (bytes.length > 0) {
    hostUart.receive(bytes, 0);
  }
  exchange.schedule(HOST_NANOS);
});

// The boot ROM's functions (RP2040 datasheet, section 2.8.3), by their codes: a table that nobody reads, and one that looks
// functions up. Whatever is called there returns at once.
const ERASE_NANOS = 45e6;
const PROGRAM_NANOS = 0.4e6;
const rom = {
  // Look a function up: its address by its code.
  0x100() {
    const code = String.fromCharCode(core.registers[1] & 0xff, (core.registers[1] >> 8) & 0xff);
    const found = { IF: 0x111, EX: 0x111, FC: 0x111, RE: 0x121, RP: 0x131, C4: 0x141 }[code];
    if (found === undefined) {
      throw new Error(`the image looks for function ${code} of the boot ROM, which is not here`);
    }
    core.registers[0] = found;
  },
  // Flash is always connected, and there is no cache.
  0x110() {},
  // Erase sectors: address, bytes.
  0x120() {
    const [address, length] = core.registers;
    chip.flash.fill(0xff, address, address + length);
    clock.tick((length / 4096) * ERASE_NANOS);
  },
  // Write pages: address, data, bytes. Ones become zeros, and nothing becomes ones.
  0x130() {
    const [address, data, length] = core.registers;
    for (let at = 0; at < length; at++) {
      chip.flash[address + at] &= chip.readUint8(data + at);
    }
    clock.tick((length / 256) * PROGRAM_NANOS);
  },
  // Copy words: to, from, bytes.
  0x140() {
    const [to, from, length] = core.registers;
    for (let at = 0; at < length; at += 4) {
      chip.writeUint32(to + at, chip.readUint32(from + at));
    }
  },
};

// Takes what is new out of RTT's first buffer (SEGGER UM08001, section 16.3).
function log() {
  const control = Number(rtt);
  const [buffer, size, write, read] = [28, 32, 36, 40].map((offset) => chip.readUint32(control + offset));
  if (write === read) {
    return;
  }
  const bytes = [];
  for (let at = read; at !== write; at = (at + 1) % size) {
    bytes.push(chip.readUint8(buffer + at));
  }
  chip.writeUint32(control + 40, write);
  put(LOG, bytes);
}

const PSM = 0x40010;
const WDSEL = 0x08;
const ALL_BUT_OSCILLATORS = 0x1fffc;
const WATCHDOG = 0x40058;

// What is on the board, around a new chip; its core is before the image's first instruction.
function wire() {
  chip.logger = logger;
  chip.gpio[DIRECTION_PIN].addListener(() => line.turned());
  // Nobody presses the button.
  chip.gpio[TRIGGER_PIN].setInputValue(true);
  [bus, hostUart] = [line, hostLine].map((wire, number) => {
    const uart = new Uart(chip, UARTS[number], wire);
    chip.uart[number] = uart;
    chip.peripherals[UARTS[number].address] = uart;
    return uart;
  });
  chip.peripherals[XIP_CONTROL] = new Idle(chip, "XIP_CTRL");
  chip.peripherals[WATCHDOG].onWatchdogTrigger = bite;
  const bootrom = new DataView(chip.bootrom.buffer);
  bootrom.setUint32(0x14, 0x00f0, true);
  bootrom.setUint32(0x18, 0x0101, true);
  core.VTOR = VECTORS;
  core.SP = chip.readUint32(VECTORS);
  core.PC = chip.readUint32(VECTORS + 4) & ~1;
  if (host !== undefined) {
    exchange.schedule(HOST_NANOS);
  }
}

// The watchdog was not fed.
function bite() {
  log();
  const where = `at 0x${core.PC.toString(16)} from 0x${core.LR.toString(16)}`;
  const selected = chip.peripherals[PSM].readUint32(WDSEL);
  if (host === undefined || selected !== ALL_BUT_OSCILLATORS) {
    throw new Error(`the watchdog was not fed, ${where}; it resets 0x${selected.toString(16)}`);
  }
  const after = hung === null ? "" : `, ${Math.round((clock.nanos - hung) / 1e6)} ms after the core hung`;
  put(NOTE, Buffer.from(`the watchdog was not fed, ${where}: the chip starts again${after}`));
  bitten = true;
  // Or it would bite again and again in no time.
  chip.peripherals[WATCHDOG].alarm.enable = false;
}

// The chip starts again.
function restart() {
  const { sram, flash, peripherals } = chip;
  const { reason, scratchData } = peripherals[WATCHDOG];
  // Nothing of the old chip happens any more.
  clock.nextAlarm = null;
  chip = new RP2040(clock);
  ({ core } = chip);
  chip.sram.set(sram);
  chip.flash.set(flash);
  Object.assign(chip.peripherals[WATCHDOG], { reason, scratchData });
  line.packet = [];
  line.turns = false;
  [hung, bitten] = [null, false];
  wire();
}

chip.flash.set(readFileSync(flash));
wire();
// Since when the core hangs, and whether the watchdog has bitten.
let [hung, bitten] = [null, false];
if (hang !== undefined) {
  clock.createAlarm(() => (hung = clock.nanos)).schedule(Number(hang) * 1e6);
}

let running = true;
let [cycles, instructions] = [0, 0];
const end = Number(seconds) * 1e9;
while (running) {
  if (bitten) {
    restart();
  } else if (hung !== null) {
    clock.tick(1000);
  } else if (core.waiting) {
    log();
    if (clock.nextAlarm === null) {
      throw new Error("the core sleeps, and nothing will wake it");
    }
    clock.tick(clock.nanosToNextAlarm);
  } else if (core.PC < ROM_BYTES) {
    const call = rom[core.PC];
    if (call === undefined) {
      throw new Error(`the image has called 0x${core.PC.toString(16)}, where no function of the boot ROM is`);
    }
    const caller = core;
    call();
    caller.PC = caller.LR & ~1;
  } else {
    const spent = core.executeInstruction();
    cycles += spent;
    instructions += 1;
    clock.tick(spent * CYCLE_NANOS);
  }
  if (clock.nanos > end) {
    throw new Error(`the image did not come to an end within ${seconds} simulated seconds`);
  }
}
const figures = { cycles, instructions, nanos: Math.round(clock.nanos), turnaround_nanos: Math.round(line.slowest) };
put(FIGURES, Buffer.from(JSON.stringify(figures)));
