//! Runs instructions that the host has put into the section `.cases`, and writes all registers after each: the same
//! image under QEMU and on the simulated core shows where they differ.
//!
//! `.cases` holds, in words: the number of instructions; how many sets of registers each is run with; 64 sets of 16
//! words (r0 to r12, lr, the APSR, unused); and for each instruction three words of code and the number of its first set.
//! What is written: for each run r0's old stack copy downwards as `dump` below lays it out, 16 words; and in the end the
//! scratch memory.
//!
//! RAM, from its start: 0x000 the code that is run, with the instruction in it; 0x400 scratch memory, the stack
//! pointer in it; 0x800 this program's variables; 0x880 what is to be written.
#![no_std]
#![no_main]

use core::arch::global_asm;
use core::panic::PanicInfo;

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}

/// Words of `.cases`.
const WORDS: usize = if cfg!(thumb2) { 160 << 10 } else { 40 << 10 };

#[unsafe(link_section = ".rodata.cases")]
#[unsafe(no_mangle)]
#[used]
static CASES: [u32; WORDS] = [0; WORDS];

/// As much of the APSR as the core has.
#[cfg(dsp)]
macro_rules! apsr {
    () => {
        "msr apsr_nzcvqg, r2"
    };
}

#[cfg(not(dsp))]
macro_rules! apsr {
    () => {
        "msr apsr_nzcvq, r2"
    };
}

#[cfg(v8m)]
macro_rules! cpu {
    () => {
        ".cpu cortex-m33"
    };
}

#[cfg(not(v8m))]
macro_rules! cpu {
    () => {
        ""
    };
}

global_asm!(
    cpu!(),
    ".section .vectors, \"a\"",
    ".word _stack_start",
    ".word start",
    // A fault ends the run with an error.
    ".rept 14",
    ".word fault + 1",
    ".endr",
    ".section .bss.random, \"aw\", %nobits",
    ".balign 8",
    ".global ram_block",
    "ram_block:",
    ".space 0x400",
    "scratch: .space 0x400",
    // 0 instructions left, 4 runs for each, 8 sets, 12 next record, 16 where to dump, 20 next set, 24 runs left of this
    // instruction, 32 semihosting's block: handle, address, length.
    "context: .space 0x80",
    "dumps: .space 0x2000",
    "dumps_end:",
    ".text",
    ".balign 4",
    ".global start",
    ".type start, %function",
    ".thumb_func",
    "start:",
    // Open the console.
    "ldr r1, =open",
    "movs r0, #1",
    "bkpt 0xab",
    "ldr r4, =context",
    "str r0, [r4, #32]",
    "ldr r5, =CASES",
    "ldr r0, [r5]",
    "str r0, [r4]",
    "ldr r0, [r5, #4]",
    "str r0, [r4, #4]",
    "adds r5, #8",
    "str r5, [r4, #8]",
    "ldr r0, =4096",
    "adds r5, r5, r0",
    "str r5, [r4, #12]",
    "ldr r0, =dumps",
    "str r0, [r4, #16]",
    // The code to RAM.
    "ldr r0, =ram_block",
    "ldr r1, =template",
    "ldr r2, =template_end",
    "1: ldr r3, [r1]",
    "str r3, [r0]",
    "adds r0, #4",
    "adds r1, #4",
    "cmp r1, r2",
    "blo 1b",
    // Scratch memory with something in it.
    "ldr r0, =scratch",
    "ldr r1, =context",
    "ldr r2, =0x89abcdef",
    "2: str r2, [r0]",
    "ldr r3, =0x9e3779b9",
    "adds r2, r2, r3",
    "adds r0, #4",
    "cmp r0, r1",
    "blo 2b",
    "next_instruction:",
    "ldr r0, =context",
    "ldr r1, [r0]",
    "subs r1, #1",
    "bmi done",
    "str r1, [r0]",
    "ldr r3, [r0, #12]",
    "ldr r2, =ram_block + 4",
    "ldmia r3!, {{r4, r5, r6, r7}}",
    "stmia r2!, {{r4, r5, r6}}",
    "str r3, [r0, #12]",
    "str r7, [r0, #20]",
    "ldr r1, [r0, #4]",
    "str r1, [r0, #24]",
    "dsb",
    "isb",
    "next_set:",
    "ldr r0, =context",
    "ldr r1, [r0, #24]",
    "subs r1, #1",
    "bmi next_instruction",
    "str r1, [r0, #24]",
    "ldr r1, [r0, #20]",
    "adds r2, r1, #1",
    "movs r3, #63",
    "ands r2, r3",
    "str r2, [r0, #20]",
    "lsls r1, r1, #6",
    "ldr r2, [r0, #8]",
    "adds r1, r1, r2",
    "ldr r2, [r1, #32]",
    "mov r8, r2",
    "ldr r2, [r1, #36]",
    "mov r9, r2",
    "ldr r2, [r1, #40]",
    "mov r10, r2",
    "ldr r2, [r1, #44]",
    "mov r11, r2",
    "ldr r2, [r1, #48]",
    "mov r12, r2",
    "ldr r2, [r1, #52]",
    "mov lr, r2",
    "ldr r2, =scratch + 0x280",
    "mov sp, r2",
    "ldr r3, =ram_block + 1",
    "ldr r2, [r1, #56]",
    apsr!(),
    "bx r3",
    "after:",
    "ldr r2, =dumps_end",
    "cmp r1, r2",
    "blo next_set",
    "bl flush",
    "b next_set",
    "done:",
    "bl flush",
    "ldr r0, =context",
    "ldr r1, =scratch",
    "str r1, [r0, #36]",
    "ldr r1, =0x400",
    "str r1, [r0, #40]",
    "adds r0, #32",
    "mov r1, r0",
    "movs r0, #5",
    "bkpt 0xab",
    "ldr r1, =0x20026",
    "movs r0, #0x18",
    "bkpt 0xab",
    "b .",
    "fault:",
    "bl flush",
    "movs r1, #0",
    "movs r0, #0x18",
    "bkpt 0xab",
    "b .",
    // Writes the dumps.
    "flush:",
    "ldr r0, =context",
    "ldr r1, =dumps",
    "ldr r2, [r0, #16]",
    "str r1, [r0, #16]",
    "str r1, [r0, #36]",
    "subs r2, r2, r1",
    "str r2, [r0, #40]",
    "adds r0, #32",
    "mov r1, r0",
    "movs r0, #5",
    "bkpt 0xab",
    "bx lr",
    ".pool",
    ".balign 4",
    "open: .word console, 4, 3",
    "console: .asciz \":tt\"",
    // What runs in RAM: registers, the instruction, a sled for branches to land on, all registers to memory.
    ".balign 4",
    "template:",
    "ldmia r1, {{r0, r1, r2, r3, r4, r5, r6, r7}}",
    "mov r8, r8",
    ".space 12",
    ".rept 16",
    "add r8, r9",
    ".endr",
    "push {{r0, r1, r2, r3, r4, r5, r6, r7}}",
    "mrs r0, apsr",
    "mov r1, r8",
    "mov r2, r9",
    "mov r3, r10",
    "mov r4, r11",
    "mov r5, r12",
    "mov r6, lr",
    "mov r7, sp",
    "push {{r0, r1, r2, r3, r4, r5, r6, r7}}",
    "ldr r0, 4f",
    "ldr r1, [r0, #16]",
    "mov r2, sp",
    ".rept 4",
    "ldmia r2!, {{r3, r4, r5, r6}}",
    "stmia r1!, {{r3, r4, r5, r6}}",
    ".endr",
    "str r1, [r0, #16]",
    "ldr r2, 5f",
    "bx r2",
    ".balign 4",
    "4: .word context",
    "5: .word after + 1",
    "template_end:",
);
