// Runs functions of an image on rp2040js' Cortex-M0+ and prints their results and cycles as JSON.
//
// Usage: node thumb_rp2040js.mjs RP2040JS ROM NAME=ADDRESS...
//   RP2040JS  folder of the npm package
//   ROM       the image's bytes, which are put where the RP2040 has its boot ROM: 16 KB from address 0
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [folder, rom, ...functions] = process.argv.slice(2);
const { RP2040 } = await import(pathToFileURL(join(folder, "dist/esm/index.js")));

// An even address at which nothing is.
const RETURN = 0x3ff0;
const MOST_INSTRUCTIONS = 50_000_000;

const bytes = new Uint8Array(16384);
bytes.set(readFileSync(rom));
const words = new Uint32Array(bytes.buffer);

const answers = {};
for (const text of functions) {
  const [name, address] = text.split("=");
  const chip = new RP2040();
  chip.loadBootrom(words);
  const core = chip.core;
  core.SP = words[0];
  core.LR = RETURN | 1;
  core.PC = Number(address) & ~1;
  const before = core.cycles;
  let [instructions, linked] = [0, 0];
  while (core.PC !== RETURN) {
    // PUSH with the LR and POP with the PC: rp2040js leaves these two out of the N registers that it counts.
    linked += (chip.readUint16(core.PC) & 0xf700) === 0xb500;
    core.executeInstruction();
    if (++instructions > MOST_INSTRUCTIONS) {
      throw new Error(`${name} does not return`);
    }
  }
  answers[name] = { cycles: core.cycles - before, instructions, linked, result: core.registers[0] >>> 0 };
}
console.log(JSON.stringify(answers));
