//! The machine with code of a few halfwords: what happens between instructions, and what stops it.
#![allow(clippy::unwrap_used)]

use thumb_cycles::insn::Arch;
use thumb_cycles::{AccessError, Board, Cause, Core, Image, Machine, Peripheral, Signals, Stop, WaitStates};

/// Vectors for 32 exceptions, all at 0x100 but for those given, and code at 0x80 and 0x100.
fn machine(core: Core, vectors: &[(usize, u32)], main: &[u16], handler: &[u16]) -> Machine {
    let mut table = [0x101u32; 32];
    (table[0], table[1]) = (0x2000_1000, 0x81);
    for &(number, address) in vectors {
        table[number] = address;
    }
    let table: Vec<u16> = table.iter().flat_map(|word| [*word as u16, (word >> 16) as u16]).collect();
    let image = Image::from_halfwords(&[(0, &table), (0x80, main), (0x100, handler)]);
    Machine::new(core, &Board::bare(), &image).unwrap()
}

/// Cycles from one breakpoint to the other.
fn cycles_between(machine: &mut Machine, from: u32, to: u32) -> u64 {
    let mut at = |address| {
        machine.set_breakpoint(address);
        assert_eq!(machine.run_until(10_000).unwrap(), Stop::Breakpoint(address));
        machine.clear_breakpoint(address);
        machine.usage().cycles
    };
    let before = at(from);
    at(to) - before
}

/// ICSR, with the pending bits of PendSV and SysTick.
const ICSR: u32 = 0xe000_ed04;
const PEND_SV: u32 = 1 << 28;
const PEND_SYSTICK: u32 = 1 << 26;

/// `str r1, [r0]`, `nop`, `b .`, and a handler of `bx lr`.
fn pending(core: Core, bits: u32) -> Machine {
    let mut machine = machine(core, &[], &[0x6001, 0xbf00, 0xe7fe], &[0x4770]);
    (machine.cpu.r[0], machine.cpu.r[1]) = (ICSR, bits);
    machine
}

#[test]
fn an_exception_takes_its_cycles_to_begin_and_to_end() {
    // BX LR takes 3, the NOP 1, on the M3 and M4; 2 and 3 on the M0+ and M0.
    for (core, entry, exit, bx) in
        [(Core::M0, 16, 11, 3), (Core::M0Plus, 15, 10, 2), (Core::M3, 12, 10, 3), (Core::M4, 12, 10, 3)]
    {
        let store = if core.arch() == Arch::V6M { 2 } else { 1 };
        let mut machine = pending(core, PEND_SV);
        assert_eq!(cycles_between(&mut machine, 0x80, 0x100), store + entry, "{}", core.name());
        let mut machine = pending(core, PEND_SV);
        assert_eq!(cycles_between(&mut machine, 0x100, 0x82), bx + exit, "{}", core.name());
        assert_eq!(machine.cpu.ipsr, 0);
        assert_eq!(machine.usage().exceptions, 1);
        assert_eq!(machine.usage().stack, 32);
    }
}

#[test]
fn a_second_exception_is_chained() {
    let mut machine = pending(Core::M4, PEND_SV | PEND_SYSTICK);
    // 1 + 12, BX 3, chained 6, BX 3, back 10.
    assert_eq!(cycles_between(&mut machine, 0x80, 0x82), 1 + 12 + 3 + 6 + 3 + 10);
    assert_eq!(machine.usage().exceptions, 2);
}

#[test]
fn primask_holds_exceptions_back() {
    // cpsid i; str r1, [r0]; nop; cpsie i; nop
    let mut machine = machine(Core::M4, &[], &[0xb672, 0x6001, 0xbf00, 0xb662, 0xbf00, 0xe7fe], &[0x4770]);
    (machine.cpu.r[0], machine.cpu.r[1]) = (ICSR, PEND_SV);
    machine.set_breakpoint(0x86);
    assert_eq!(machine.run_until(1000).unwrap(), Stop::Breakpoint(0x86));
    assert_eq!(machine.usage().exceptions, 0);
    machine.set_breakpoint(0x88);
    assert_eq!(machine.run_until(1000).unwrap(), Stop::Breakpoint(0x88));
    assert_eq!(machine.usage().exceptions, 1);
}

#[test]
fn sleep_lasts_until_the_timer_and_is_counted() {
    // A SysTick of 1000 cycles with its interrupt: str r1, [r0, #4]; str r2, [r0, #8]; str r3, [r0]; wfi; b .-2
    let mut machine = machine(Core::M4, &[], &[0x6041, 0x6082, 0x6003, 0xbf30, 0xe7fd], &[0x4770]);
    machine.cpu.r[..4].copy_from_slice(&[0xe000_e010, 999, 0, 7]);
    assert_eq!(machine.run_until(100_000).unwrap(), Stop::Limit);
    let usage = machine.usage();
    assert_eq!(usage.cycles, 100_000);
    assert_eq!(usage.exceptions, 99);
    // 12 + 3 + 10 for the interrupt, then B 2 and WFI 1.
    let busy = usage.cycles - usage.asleep;
    assert!((99 * 28..=99 * 28 + 10).contains(&busy), "{busy}");
}

#[test]
fn a_core_that_nothing_can_wake_is_a_fault() {
    let fault = machine(Core::M4, &[], &[0xbf30], &[]).run_until(u64::MAX).unwrap_err();
    assert_eq!(fault.cause, Cause::SleepsForever);
}

#[test]
fn svc_calls_its_handler() {
    // svc #7; nop; b .
    let mut machine = machine(Core::M0, &[], &[0xdf07, 0xbf00, 0xe7fe], &[0x4770]);
    machine.set_breakpoint(0x100);
    assert_eq!(machine.run_until(1000).unwrap(), Stop::Breakpoint(0x100));
    assert_eq!(machine.cpu.ipsr, 11);
    assert_eq!(machine.cpu.r[14], 0xffff_fff9);
    machine.set_breakpoint(0x82);
    assert_eq!(machine.run_until(1000).unwrap(), Stop::Breakpoint(0x82));
}

#[test]
fn breakpoints_cost_nothing_and_work_in_it_blocks() {
    // cmp r0, r0; ite ne; movne r1, #1; moveq r1, #2; b .
    let code = [0x4280, 0xbf14, 0x2101, 0x2102, 0xe7fe];
    let run = |breakpoints: &[u32]| {
        let mut machine = machine(Core::M4, &[], &code, &[]);
        for &address in breakpoints {
            machine.set_breakpoint(address);
        }
        let mut stops = Vec::new();
        while let Stop::Breakpoint(address) = machine.run_until(20).unwrap() {
            stops.push(address);
        }
        assert_eq!(machine.cpu.r[1], 2);
        (stops, machine.usage().cycles, machine.usage().instructions)
    };
    let (none, cycles, instructions) = run(&[]);
    assert!(none.is_empty());
    assert_eq!(run(&[0x82, 0x84, 0x86]), (vec![0x82, 0x84, 0x86], cycles, instructions));
}

#[test]
fn code_that_is_overwritten_is_decoded_again() {
    // In RAM: movs r0, #1; strh r1, [r2]; b 0x20000000; where r1 is the code of `bx lr`, over the first.
    let mut machine = machine(Core::M4, &[], &[0xe7fe], &[]);
    assert!(machine.memory_mut().program(0x2000_0000, &[0x01, 0x20, 0x11, 0x80, 0xfc, 0xe7]));
    assert_eq!(machine.call_function(0x2000_0000, &[0, 0x4770, 0x2000_0000], 100).unwrap(), Stop::Returned);
    assert_eq!(machine.cpu.r[0], 1);
}

#[test]
fn the_host_calls_functions_and_is_told_of_marks() {
    // str r0, [r1]; adds r0, r0, r0; bx lr
    let mut machine = machine(Core::M0Plus, &[], &[0xe7fe], &[0x6008, 0x1800, 0x4770]);
    let stop = machine.call_function(0x101, &[21, 0xe000_0008], 100).unwrap();
    assert_eq!(stop, Stop::ItmWrite { port: 2, value: 21 });
    assert_eq!(machine.run_until(100).unwrap(), Stop::Returned);
    assert_eq!(machine.cpu.r[0], 42);
    assert_eq!(machine.usage().cycles, 2 + 1 + 2);
}

#[test]
fn cyccnt_counts_while_it_is_enabled() {
    // ldr r2, [r0, #4]; str r1, [r0]; ldr r3, [r0, #4]; nop; nop; ldr r4, [r0, #4]; b .
    let code = [0x6842, 0x6001, 0x6843, 0xbf00, 0xbf00, 0x6844, 0xe7fe];
    let mut machine = machine(Core::M4, &[], &code, &[]);
    (machine.cpu.r[0], machine.cpu.r[1]) = (0xe000_1000, 1);
    assert_eq!(machine.run_until(50).unwrap(), Stop::Limit);
    // LDR 3 after a store, one NOP folded, one counted.
    assert_eq!(machine.cpu.r[4] - machine.cpu.r[3], 4);
    assert_eq!(machine.cpu.r[2], 0);
}

#[test]
fn call_paths_and_functions_add_up() {
    // main: bl 0x100; bl 0x100; b .    0x100: nop; bx lr
    let mut machine = machine(Core::M4, &[], &[0xf000, 0xf83e, 0xf000, 0xf83c, 0xe7fe], &[0xbf00, 0x4770]);
    machine.set_breakpoint(0x88);
    assert_eq!(machine.run_until(1000).unwrap(), Stop::Breakpoint(0x88));
    let cycles = machine.usage().cycles;
    let paths = machine.call_paths();
    assert_eq!(paths.len(), 2);
    assert_eq!((paths[0].inclusive, paths[1].calls, paths[1].cycles), (cycles, 2, 8));
    assert_eq!(machine.self_cycles().iter().map(|function| function.cycles).sum::<u64>(), cycles);
    machine.reset_profile();
    assert!(machine.self_cycles().is_empty());
}

#[test]
fn wait_states_slow_code_and_data_down() {
    // ldr r1, [r0]; four times; b .
    let run = |cycles| {
        let mut machine = machine(Core::M4, &[], &[0x6801, 0x6801, 0x6801, 0x6801, 0xe7fe], &[]);
        let region = machine.memory_mut().region_mut(0).unwrap();
        region.wait_states = WaitStates { cycles, line: 4, ..WaitStates::NONE };
        cycles_between(&mut machine, 0x80, 0x88)
    };
    assert_eq!(run(0), 5);
    // Two lines of code, and four words of data from the same memory.
    assert_eq!(run(2), 5 + 2 * 2 + 4 * 2);
}

fn cause(core: Core, main: &[u16], r0: u32) -> (Cause, String) {
    let mut machine = machine(core, &[], main, &[]);
    machine.cpu.r[0] = r0;
    let fault = machine.run_until(1000).unwrap_err();
    (fault.cause, fault.to_string())
}

#[test]
fn faults_say_what_where_and_the_registers() {
    let (found, text) = cause(Core::M4, &[0xde00], 0x1234);
    assert_eq!(found, Cause::Undefined { first: 0xde00, second: None });
    assert!(text.contains("at 0x00000080") && text.contains("0xde00 is no instruction"), "{text}");
    assert!(text.contains("r0 0x00001234") && text.contains("sp 0x20001000"), "{text}");

    // vadd.f32 s0, s0, s0
    let (_, text) = cause(Core::M4, &[0xee30, 0x0a00], 0);
    assert!(text.contains("needs an FPU"), "{text}");
    // movw r0, #0 on an M0+
    let (found, _) = cause(Core::M0Plus, &[0xf240, 0x0000], 0);
    assert_eq!(found, Cause::Undefined { first: 0xf240, second: Some(0) });
    // ldr r1, [r0]
    let access = |address, error| Cause::Access { address, write: false, error };
    assert_eq!(cause(Core::M0, &[0x6801], 0x2000_0002).0, access(0x2000_0002, AccessError::Unaligned));
    assert_eq!(cause(Core::M4, &[0x6801], 0x4444_0000).0, access(0x4444_0000, AccessError::Unmapped));
    // str r1, [r0]
    let (found, text) = cause(Core::M4, &[0x6001], 0x40);
    assert_eq!(found, Cause::Access { address: 0x40, write: true, error: AccessError::ReadOnly });
    assert!(text.contains("store to 0x00000040, which is flash"), "{text}");
    // bx r0
    assert_eq!(cause(Core::M4, &[0x4700], 0x100).0, Cause::ArmState { target: 0x100 });
    // bkpt 0
    assert_eq!(cause(Core::M4, &[0xbe00], 0).0, Cause::Breakpoint { number: 0 });
}

#[test]
fn semihosting_writes_and_ends() {
    // bkpt 0xab; ldr r1, [pc, #4]; movs r0, #0x18; bkpt 0xab; .word 0x20026
    let mut machine = machine(Core::M0, &[], &[0xbeab, 0x4901, 0x2018, 0xbeab, 0x0026, 0x0002], &[]);
    assert!(machine.memory_mut().program(0x2000_0000, b"hello\0"));
    (machine.cpu.r[0], machine.cpu.r[1]) = (4, 0x2000_0000);
    assert_eq!(machine.run_until(1000).unwrap(), Stop::Exit(0));
    assert_eq!(machine.semihosting.console, b"hello");
}

#[test]
fn an_image_that_does_not_fit_is_refused() {
    let image = Image::from_halfwords(&[(0x3000_0000, &[0])]);
    let error = Machine::new(Core::M4, &Board::bare(), &image).err().unwrap();
    assert!(error.to_string().contains("0x30000000"), "{error}");
}

/// A timer that asks for an interrupt every so many cycles, and sends a byte each time.
struct Ticker {
    period: u32,
    due: Option<u64>,
    ticks: u32,
    heard: u32,
}

impl Peripheral for Ticker {
    fn read(&mut self, offset: u32, _: u64) -> u32 {
        [self.period, self.ticks, self.heard].get(offset as usize / 4).copied().unwrap_or(0)
    }

    fn write(&mut self, offset: u32, value: u32, bytes: u32, now: u64) {
        assert_eq!((offset, bytes), (0, 4));
        self.period = value;
        self.due = (value > 0).then(|| now + u64::from(value));
    }

    fn advance(&mut self, now: u64) -> Signals {
        let Some(due) = self.due.filter(|&due| due <= now) else { return Signals::default() };
        self.due = Some(due + u64::from(self.period));
        self.ticks += 1;
        Signals { interrupts: 0b10, sent: Some(self.ticks as u8) }
    }

    fn next_event(&self, _: u64) -> Option<u64> {
        self.due
    }

    fn receive(&mut self, bytes: &[u8], _: u64) {
        self.heard += bytes.len() as u32;
    }
}

fn ticker() -> Box<Ticker> {
    Box::new(Ticker { period: 0, due: None, ticks: 0, heard: 0 })
}

#[test]
fn a_peripheral_is_read_interrupts_and_sends() {
    // str r1, [r0]; str r3, [r2]; wfi; b .-2; the handler: ldr r4, [r0, #4]; ldrb r5, [r0, #8]; bx lr
    let mut machine =
        machine(Core::M4, &[(16 + 6, 0x101)], &[0x6001, 0x6013, 0xbf30, 0xe7fd], &[0x6844, 0x7a05, 0x4770]);
    machine.attach(0x4000_0000, 12, &[5, 6], ticker()).unwrap();
    machine.cpu.r[..4].copy_from_slice(&[0x4000_0000, 1000, 0xe000_e100, 1 << 6]);
    for tick in 1..=3 {
        assert_eq!(machine.run_until(10_000).unwrap(), Stop::Sent { peripheral: 0x4000_0000, byte: tick });
        // The store took a cycle, and the peripheral saw it before that was counted.
        assert_eq!(machine.usage().cycles, 1000 * u64::from(tick));
        assert!(machine.deliver(0x4000_0000, b"ab"));
    }
    assert_eq!(machine.run_until(3500).unwrap(), Stop::Limit);
    assert_eq!((machine.usage().exceptions, machine.cpu.r[4], machine.cpu.r[5]), (3, 3, 6));
    assert!(!machine.deliver(0x4000_0004, b"a"));
}

#[test]
fn a_peripheral_has_registers_and_interrupts_of_its_own() {
    let mut machine = machine(Core::M4, &[], &[0xe7fe], &[]);
    machine.attach(0x4000_0000, 0x1000, &[], ticker()).unwrap();
    let mut refused =
        |base, interrupts: &[u16]| machine.attach(base, 0x100, interrupts, ticker()).unwrap_err().to_string();
    assert!(refused(0x4000_0f80, &[]).contains("over another peripheral"));
    assert!(refused(0x1fff_ff80, &[]).contains("over RAM"));
    assert!(refused(0xe000_e000, &[]).contains("over the core's own registers"));
    assert!(refused(0x5000_0000, &[3, 240]).contains("the highest number 240"));
    machine.attach(0x4000_1000, 0x100, &[239], ticker()).unwrap();
}

#[test]
fn an_interrupt_that_msr_lets_in_comes_at_once() {
    // msr primask, r1; str r2, [r0]; nop; msr primask, r3; nop; b .
    let code = [0xf381, 0x8810, 0x6002, 0xbf00, 0xf383, 0x8810, 0xbf00, 0xe7fe];
    let mut machine = machine(Core::M4, &[], &code, &[0x4770]);
    machine.cpu.r[..4].copy_from_slice(&[ICSR, 1, PEND_SV, 0]);
    machine.set_breakpoint(0x88);
    assert_eq!(machine.run_until(1000).unwrap(), Stop::Breakpoint(0x88));
    assert_eq!(machine.usage().exceptions, 0);
    machine.set_breakpoint(0x8c);
    assert_eq!(machine.run_until(1000).unwrap(), Stop::Breakpoint(0x8c));
    assert_eq!(machine.usage().exceptions, 1);
}
