//! Random instructions on the simulated cores and under QEMU: all registers and flags after each are the same.
//!
//! Half are variations of those in our own images (the test fails if some kind of instruction in them was not
//! tried), half are drawn from all instructions that the core has. The image `random` runs them; see there. With
//! another `BUNRAKU_SEED` other instructions are tried.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{cargo, require_program, require_target, vectors, workspace};
use host_sim::{board, profile};
use object::{Object, ObjectSection, ObjectSymbol, SectionKind};
use puppet_file::{Puppet, to_bytes};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::process::{Command, Stdio};
use thumb_cycles::decode::{decode, is_wide};
use thumb_cycles::insn::{Arch, Class, Index, Insn, Op, Src};
use thumb_cycles::{Board, Core, Cpu, Image, Machine, Region, Stop};

/// Sets of registers: the first half any numbers, the second half addresses (in even registers) and small offsets.
const SETS: u32 = 64;

/// Bytes of code for each case; what is not used is NOPs.
const SLOT: usize = 12;

/// Where in RAM the slot, the sled's end, and the scratch memory are (`random.rs`).
const SLOT_AT: u32 = 4;
const SLED_END: u32 = 4 + 12 + 32;
const SCRATCH: u32 = 0x400;
const SCRATCH_END: u32 = 0x800;
const STACK: u32 = SCRATCH + 0x280;

const NOP: u16 = 0xbf00;

/// Numbers by xorshift (Marsaglia), so that failures can be repeated.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 16) as u32
    }

    fn below(&mut self, limit: u32) -> u32 {
        self.next() % limit
    }

    fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len() as u32) as usize]
    }
}

/// Where the numbers begin: `BUNRAKU_SEED`, an odd number, tries other instructions.
fn seed() -> u64 {
    let chosen = std::env::var("BUNRAKU_SEED").ok().map_or(1, |text| text.parse::<u64>().unwrap());
    0x9e37_79b9_7f4a_7c15u64.wrapping_mul(chosen)
}

/// A kind of instruction: what distinguishes the paths through the simulator.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Kind {
    op: u8,
    detail: u8,
    wide: bool,
    sets: bool,
}

fn kind(insn: &Insn) -> Kind {
    let memory = matches!(insn.class, Class::Load | Class::Store | Class::LoadDouble | Class::StoreDouble);
    let detail = match insn.op {
        Op::Parallel => insn.imm as u8,
        Op::Ldm | Op::Stm => insn.amount,
        _ if memory => insn.index as u8,
        _ => insn.src as u8,
    };
    Kind { op: insn.op as u8, detail, wide: insn.len == 4, sets: insn.s }
}

/// Whether the image `random` can run it: it stays in the slot and its sled, and leaves the core's mode alone.
fn can_run(insn: &Insn) -> bool {
    let pc = 1 << 15;
    match insn.op {
        Op::Undefined | Op::Coprocessor | Op::Undecoded | Op::HostBreakpoint => false,
        Op::It | Op::Svc | Op::Bkpt | Op::Wfe | Op::Wfi | Op::Cps | Op::Sev | Op::Tt => false,
        // Flags only.
        Op::Mrs | Op::Msr => insn.imm == 0 && insn.d != 13 && insn.n != 13,
        // Exclusives succeed where nothing came in between, which QEMU decides by the value.
        Op::StoreRelease | Op::LoadAcquire => !insn.s,
        Op::LdrPc | Op::Tbb | Op::Tbh | Op::AddPc => false,
        Op::Ldm => insn.writes & pc == 0,
        _ => true,
    }
}

/// ARMv7-M leaves open what these do.
fn is_unpredictable(insn: &Insn, in_it: bool) -> bool {
    let bit = |register: u8| 1u16 << register;
    let sp = bit(13);
    let (sp_written, sp_read) = (insn.writes & sp != 0, insn.reads & sp != 0);
    let memory = !matches!(insn.index, Index::Literal) && insn.address != 0;
    let plain_sp = matches!(insn.op, Op::Add | Op::Sub | Op::Mov | Op::Cmp);
    if (sp_written || sp_read) && !memory && !plain_sp && !matches!(insn.op, Op::Bx | Op::BlxReg) {
        return true;
    }
    // The wide forms of ADD, SUB, MOV and CMP with the sp have many conditions of their own.
    if insn.len == 4 && plain_sp && (sp_written || sp_read) {
        return true;
    }
    if memory {
        let base = bit(insn.n);
        let transferred = (insn.reads | insn.writes) & !insn.address;
        if insn.writes_back() && transferred & base != 0 {
            return true;
        }
        let others = insn.address & !base;
        if others & sp != 0 || transferred & sp != 0 {
            return true;
        }
        if matches!(insn.op, Op::Stm | Op::Ldm) && insn.s && insn.imm & u32::from(base) != 0 {
            return true;
        }
        if matches!(insn.op, Op::Ldrd) && insn.d == insn.a {
            return true;
        }
        if matches!(insn.class, Class::LoadDouble)
            && insn.writes_back()
            && (insn.d == insn.n || insn.a == insn.n)
        {
            return true;
        }
    }
    if in_it
        && matches!(insn.class, Class::Branch | Class::Call | Class::CallRegister | Class::BranchRegister)
    {
        return true;
    }
    // CMP of two low registers in the form for high ones; ADD and MOV that write the pc.
    if insn.op == Op::Cmp && insn.len == 2 && insn.src == Src::Reg && (insn.n == 15 || insn.m == 15) {
        return true;
    }
    insn.m == 15 && insn.src == Src::Reg && matches!(insn.op, Op::Add | Op::Mov | Op::Cmp)
        || matches!(insn.op, Op::AddPc | Op::MovPc | Op::Bx | Op::BlxReg) && insn.m == 15
}

/// Whether an address is made of the lr, which lies in the code that is run: what is stored there would be executed. Or
/// whether it is among the core's own registers, of which QEMU has more.
fn reaches_code_or_core(insn: &Insn, set: &[u32; 16]) -> bool {
    if insn.address & 1 << 14 != 0 {
        return true;
    }
    let value = |register: u8| set[usize::from(register)];
    insn.index == Index::Register && value(insn.n).wrapping_add(value(insn.m) << insn.amount) >> 28 == 0xe
}

/// Code for one slot.
#[derive(Clone)]
struct Case {
    code: Vec<u16>,
    kinds: Vec<Kind>,
    first_set: u32,
}

struct Generator {
    arch: Arch,
    core: Core,
    numbers: Numbers,
    sets: Vec<[u32; 16]>,
    /// Runs each case before it is kept: only what stays in scratch memory and in the sled is.
    trial: Machine,
    ram: u32,
    runs: u32,
}

impl Generator {
    fn decode(&self, code: &[u16], it: u8) -> Insn {
        decode(self.arch, self.ram + SLOT_AT, code[0], code.get(1).copied().unwrap_or(0), it)
    }

    /// A case for this code, if the image can run it.
    fn case(&mut self, code: Vec<u16>, insns: &[Insn]) -> Option<Case> {
        if code.len() * 2 > SLOT {
            return None;
        }
        let memory = insns.iter().any(|insn| insn.address != 0);
        let half = SETS / 2;
        let first_set = self.numbers.below(half / 2) + if memory { half } else { 0 };
        let mut padded = code.clone();
        padded.resize(SLOT / 2, NOP);
        // The M0 has the NOP hint too.
        let bytes: Vec<u8> = padded.iter().flat_map(|half| half.to_le_bytes()).collect();
        for run in 0..self.runs {
            let set = self.sets[((first_set + run) % SETS) as usize];
            if insns.iter().any(|insn| reaches_code_or_core(insn, &set)) || !self.try_once(&bytes, &set) {
                return None;
            }
        }
        Some(Case { code: padded, kinds: insns.iter().map(kind).collect(), first_set })
    }

    fn try_once(&mut self, slot: &[u8], set: &[u32; 16]) -> bool {
        let machine = &mut self.trial;
        let ram = self.ram;
        machine.cpu = Cpu::new(self.arch);
        machine.cpu.r[..13].copy_from_slice(&set[..13]);
        machine.cpu.r[13] = ram + STACK;
        machine.cpu.r[14] = set[13];
        machine.cpu.flags = thumb_cycles::Flags::from_bits(set[14]);
        machine.cpu.pc = ram + SLOT_AT;
        if !machine.memory_mut().program(ram + SLOT_AT, slot) {
            return false;
        }
        let before = machine.memory().bytes(ram, SCRATCH as usize).map(<[u8]>::to_vec);
        let limit = machine.usage().cycles + 500;
        let stopped = machine.run_until(limit);
        let intact = machine.memory().bytes(ram, SCRATCH as usize) == before.as_deref();
        if !intact {
            machine.memory_mut().program(ram, &before.unwrap());
        }
        let sp = machine.cpu.r[13];
        matches!(stopped, Ok(Stop::Breakpoint(_)))
            && intact
            && (ram + SCRATCH + 0x80..=ram + SCRATCH_END - 0x40).contains(&sp)
    }

    /// One instruction, from this one by changing some of its bits, of the same kind.
    fn variation(&mut self, original: &[u16]) -> Option<Case> {
        let wanted = kind(&self.decode(original, 0));
        for _ in 0..40 {
            let mut code = original.to_vec();
            let flips = 1 + self.numbers.below(6);
            for _ in 0..flips {
                let at = self.numbers.below(code.len() as u32) as usize;
                code[at] ^= 1 << self.numbers.below(16);
            }
            if let Some(case) = self.single(code, Some(wanted)) {
                return Some(case);
            }
        }
        self.single(original.to_vec(), Some(wanted))
    }

    /// The branch with an offset that lands in the sled; other instructions as they are (encodings: DDI 0403, A7.7.12,
    /// A7.7.18, A7.7.21).
    fn aimed(&mut self, mut code: Vec<u16>) -> Vec<u16> {
        let halves = self.numbers.below(16) as u16;
        let op = self.decode(&code, 0).op;
        match (op, code.as_mut_slice()) {
            (Op::B, [first]) if *first >> 11 == 0b11100 => *first = 0xe000 | halves,
            (Op::B, [first]) => *first = *first & 0xff00 | halves,
            (Op::Cbz | Op::Cbnz, [first]) => *first = *first & !0x02f8 | halves << 3,
            (Op::B, [first, second]) if *second & 0x1000 == 0 => {
                (*first, *second) = (*first & 0xfbc0, 0x8000 | halves);
            }
            (Op::B, [first, second]) => (*first, *second) = (0xf000, 0xb800 | halves),
            (Op::Bl, [first, second]) => (*first, *second) = (0xf000, 0xf800 | halves),
            _ => {}
        }
        code
    }

    /// A case of this instruction alone.
    fn single(&mut self, code: Vec<u16>, wanted: Option<Kind>) -> Option<Case> {
        if is_wide(code[0]) != (code.len() == 2) {
            return None;
        }
        let code = self.aimed(code);
        let insn = self.decode(&code, 0);
        let kind = kind(&insn);
        if wanted.is_some_and(|wanted| wanted != kind) || !can_run(&insn) || is_unpredictable(&insn, false) {
            return None;
        }
        self.case(code, &[insn])
    }

    fn random_code(&mut self) -> Vec<u16> {
        let first = self.numbers.next() as u16;
        if self.arch == Arch::V6M || self.numbers.below(2) == 0 {
            return vec![first];
        }
        let second = self.numbers.next() as u16;
        // The fields that mostly have to be ones.
        let second = if self.numbers.below(4) == 0 { second | 0xf000 } else { second };
        vec![first | 0xe800, second]
    }

    /// IT and up to three random instructions.
    fn block(&mut self) -> Option<Case> {
        let condition = self.numbers.below(14);
        let count = 1 + self.numbers.below(3);
        let mut mask = 1 << (4 - count);
        for place in 1..count {
            let then = (condition & 1) ^ self.numbers.below(2);
            mask |= then << (4 - place);
        }
        let it = (condition << 4 | mask) as u8;
        let (mut code, mut insns) = (vec![0xbf00 | u16::from(it)], Vec::new());
        let mut state = it;
        let mut written = 0;
        for _ in 0..count {
            let (next, insn) = (0..200).find_map(|_| {
                let next = self.random_code();
                if is_wide(next[0]) != (next.len() == 2) {
                    return None;
                }
                let insn = self.decode(&next, state);
                let fits = can_run(&insn)
                    && !is_unpredictable(&insn, true)
                    && insn.op != Op::Cbz
                    && insn.op != Op::Cbnz;
                // What was loaded differs from the trial, and so would an address made of it.
                let known = insn.address & written == 0;
                (fits && known && insn.class != Class::Branch).then_some((next, insn))
            })?;
            written |= insn.writes;
            insns.push(insn);
            code.extend(next);
            state = thumb_cycles::decode::advance_it(state);
        }
        self.case(code, &insns)
    }
}

/// The distinct instructions of an image's code.
fn instructions_of(elf: &[u8]) -> BTreeSet<Vec<u16>> {
    let file = object::File::parse(elf).unwrap();
    let mut found = BTreeSet::new();
    for section in file.sections().filter(|section| section.kind() == SectionKind::Text) {
        let data = section.data().unwrap();
        // $t and $d say where code and data begin (ELF for the Arm Architecture, 4.5.5).
        let mut marks: Vec<(u64, bool)> = file
            .symbols()
            .filter(|symbol| symbol.section_index() == Some(section.index()))
            .filter_map(|symbol| match symbol.name() {
                Ok(name) if name.starts_with("$t") => Some((symbol.address(), true)),
                Ok(name) if name.starts_with("$d") => Some((symbol.address(), false)),
                _ => None,
            })
            .collect();
        marks.sort_unstable();
        marks.push((section.address() + data.len() as u64, false));
        for pair in marks.windows(2).filter(|pair| pair[0].1) {
            let range = (pair[0].0 - section.address()) as usize..(pair[1].0 - section.address()) as usize;
            let halves: Vec<u16> =
                data[range].chunks_exact(2).map(|half| u16::from_le_bytes([half[0], half[1]])).collect();
            let mut at = 0;
            while let Some(&first) = halves.get(at) {
                let len = if is_wide(first) { 2 } else { 1 };
                if let Some(code) = halves.get(at..at + len) {
                    found.insert(code.to_vec());
                }
                at += len;
            }
        }
    }
    found
}

/// Register sets: interesting numbers, and addresses with offsets.
fn register_sets(arch: Arch, numbers: &mut Numbers, ram: u32) -> Vec<[u32; 16]> {
    const EDGES: [u32; 12] =
        [0, 1, 2, 31, 32, 0x7fff, 0x8000, 0xffff, 0x7fff_ffff, 0x8000_0000, 0x8000_0001, u32::MAX];
    let mut sets = Vec::new();
    for number in 0..SETS {
        let mut set = [0; 16];
        for (register, value) in set.iter_mut().enumerate().take(13) {
            *value = if number < SETS / 2 {
                match numbers.below(3) {
                    0 => numbers.one_of(&EDGES),
                    1 => numbers.next() >> numbers.below(32),
                    _ => numbers.next(),
                }
            } else if register % 2 == 0 {
                ram + SCRATCH + 0x180 + 4 * numbers.below(32)
            } else {
                4 * numbers.below(16)
            };
        }
        // A place in the sled, for BX and BLX.
        set[13] = (ram + SLED_END - 2 * numbers.below(16)) | 1;
        let apsr = match arch {
            Arch::V6M => 0xf000_0000,
            Arch::V7M => 0xf800_0000,
            Arch::V7EM | Arch::V8M => 0xf80f_0000,
        };
        set[14] = numbers.next() & apsr;
        sets.push(set);
    }
    sets
}

/// What the image writes under QEMU, and whether it ends as it should.
fn qemu(machine: &str, image: &std::path::Path) -> (Vec<u8>, bool) {
    let output = Command::new("qemu-system-arm")
        .args(["-machine", machine, "-display", "none", "-monitor", "none", "-serial", "null"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(image)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    (output.stdout, output.status.success())
}

/// Registers in a dump, in the order in which `random.rs` stacks them.
const DUMPED: [&str; 16] = [
    "apsr", "r8", "r9", "r10", "r11", "r12", "lr", "sp - 32", "r0", "r1", "r2", "r3", "r4", "r5", "r6", "r7",
];

fn compare(core: Core, machine: &str, board: &Board, instructions: usize, runs: u32) {
    if !require_target(core.target()) || !require_program("qemu-system-arm") {
        return;
    }
    let mut elf = fs::read(cargo::image("calibration", "random", core.target(), "firmware", &[])).unwrap();
    let image = Image::parse(&elf).unwrap();
    let ram = image.symbol("ram_block").unwrap();
    let mut numbers = Numbers(seed());
    let sets = register_sets(core.arch(), &mut numbers, ram);

    // What may be reached while a case is tried: the code that is run and the scratch memory.
    let flash = board.regions[0].clone();
    let narrow = Board {
        regions: vec![
            flash,
            Region::new("the image's code and scratch memory", ram, SCRATCH_END as usize, true),
        ],
        ..board.clone()
    };
    let mut trial = Machine::new(core, &narrow, &image).unwrap();
    let template = image.symbol("template").unwrap();
    let code = trial.memory().bytes(template, 0x80).unwrap().to_vec();
    assert!(trial.memory_mut().program(ram, &code));
    trial.set_breakpoint(ram + SLED_END);
    let mut generator = Generator { arch: core.arch(), core, numbers, sets, trial, ram, runs };

    let mut ours: BTreeMap<Kind, Vec<Vec<u16>>> = BTreeMap::new();
    for elf in images(core) {
        for code in instructions_of(&elf) {
            let insn = generator.decode(&code, 0);
            if can_run(&insn) && !is_unpredictable(&insn, false) {
                ours.entry(kind(&insn)).or_default().push(code);
            }
        }
    }
    let mut cases = Vec::new();
    let each = instructions / 2 / ours.len().max(1);
    for originals in ours.values() {
        for _ in 0..each {
            let original = &originals[generator.numbers.below(originals.len() as u32) as usize];
            cases.extend(generator.variation(original));
        }
    }
    let from_images = cases.len();
    let mut attempts = 0;
    while cases.len() < instructions {
        attempts += 1;
        assert!(attempts < 1000 * instructions, "{}: hardly any instruction can be tried", core.name());
        let block = generator.arch != Arch::V6M && generator.numbers.below(4) == 0;
        let code = generator.random_code();
        cases.extend(if block { generator.block() } else { generator.single(code, None) });
    }
    let tried: BTreeSet<Kind> = cases.iter().flat_map(|case| case.kinds.iter().copied()).collect();

    // The cases into the image.
    let file = object::File::parse(elf.as_slice()).unwrap();
    let symbol = file.symbols().find(|symbol| symbol.name() == Ok("CASES")).unwrap();
    let section = file.section_by_index(symbol.section_index().unwrap()).unwrap();
    let (offset, _) = section.file_range().unwrap();
    let at = (offset + symbol.address() - section.address()) as usize;
    let room = symbol.size() as usize;
    let mut words = vec![cases.len() as u32, runs];
    words.extend(generator.sets.iter().flatten());
    for case in &cases {
        words.extend(case.code.chunks(2).map(|pair| u32::from(pair[0]) | u32::from(pair[1]) << 16));
        words.push(case.first_set);
    }
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    assert!(bytes.len() <= room, "{} bytes of cases, room for {room}", bytes.len());
    elf[at..at + bytes.len()].copy_from_slice(&bytes);

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("random.elf");
    fs::write(&path, &elf).unwrap();
    let (theirs, ended) = qemu(machine, &path);
    let mut simulated = Machine::new(core, board, &Image::parse(&elf).unwrap()).unwrap();
    let mut here = Vec::new();
    let code = simulated
        .run_to_exit(&mut |_| Vec::new(), &mut |bytes| here.extend_from_slice(bytes), u64::MAX)
        .unwrap_or_else(|fault| panic!("{}: {fault}", core.name()));
    assert_eq!(code, Some(0));

    let mut wrong = String::new();
    let mut count = 0;
    for (number, (ours, theirs)) in here.chunks(64).zip(theirs.chunks(64)).enumerate() {
        let Some(case) = cases.get(number / runs as usize) else { break };
        if ours != theirs {
            count += 1;
            if count <= 10 {
                report(&mut wrong, &generator, case, number as u32 % runs, ours, theirs);
            }
        }
    }
    if !ended {
        let last = &cases[theirs.len() / 64 / runs as usize];
        let insn = generator.decode(&last.code, 0);
        writeln!(wrong, "QEMU's {machine} failed in {:04x?} {insn:?}", last.code).unwrap();
    }
    assert!(count == 0 && ended, "{}: {count} runs differ from QEMU's:\n{wrong}", core.name());
    let executed = cases.len() * runs as usize;
    assert_eq!(here.len(), executed * 64 + (SCRATCH_END - SCRATCH) as usize);
    assert!(here == theirs, "{}: scratch memory differs", core.name());
    let missing = ours.keys().filter(|kind| !tried.contains(kind)).count();
    println!(
        "{}: {executed} instructions as in QEMU's {machine}: {} cases, {from_images} of them variations of our images' \
         {} kinds of instruction; {} kinds in all",
        core.name(),
        cases.len(),
        ours.len(),
        tried.len()
    );
    let names: Vec<String> = ours
        .iter()
        .filter(|(kind, _)| !tried.contains(kind))
        .map(|(_, code)| format!("{:04x?} {:?}", code[0], generator.decode(&code[0], 0).op))
        .collect();
    assert!(missing == 0, "{}: not tried: {names:?}", generator.core.name());
}

fn report(wrong: &mut String, generator: &Generator, case: &Case, run: u32, ours: &[u8], theirs: &[u8]) {
    let insn = generator.decode(&case.code, 0);
    writeln!(wrong, "{:04x?} {insn:?}", case.code).unwrap();
    let set = generator.sets[((case.first_set + run) % SETS) as usize];
    writeln!(wrong, "  in: {set:08x?}").unwrap();
    let words = |bytes: &[u8]| -> Vec<u32> {
        bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect()
    };
    for ((name, ours), theirs) in DUMPED.iter().zip(words(ours)).zip(words(theirs)) {
        if ours != theirs {
            writeln!(wrong, "  {name}: {ours:08x} here, {theirs:08x} in QEMU").unwrap();
        }
    }
}

/// Our own images for a core: those of tests, those that are profiled, and the board's.
fn images(core: Core) -> Vec<Vec<u8>> {
    let target = core.target();
    let test = |binary| fs::read(cargo::image("on-target", binary, target, "firmware", &[])).unwrap();
    let clip = vectors::with_trials().into_iter().find(|vector| vector.name == "sample").unwrap().bytes;
    let puppet = Puppet::read(&workspace().join("puppets/sample.toml")).unwrap();
    let map = puppet.map(&mocap::sample::clip().skeleton).unwrap();
    let mut images = vec![test("stream")];
    if core.arch() != Arch::V6M {
        images.push(test("in-place"));
    }
    let profiled = [
        profile::images(&clip, &[target], true).unwrap(),
        profile::tick_images(&clip, &to_bytes(&map), &[target], true).unwrap(),
    ];
    images.extend(profiled.into_iter().flatten().map(|image| image.elf));
    if core == Core::M4 {
        images.push(board::QEMU_MPS2.build(&clip, &map, 0).unwrap());
    }
    images
}

#[test]
fn an_m0_as_in_qemu() {
    compare(Core::M0, "microbit", &Board::microbit(), 8_000, 32);
}

#[test]
fn an_m3_as_in_qemu() {
    compare(Core::M3, "mps2-an385", &Board::mps2(), 24_000, 16);
}

#[test]
fn an_m4_as_in_qemu() {
    compare(Core::M4, "mps2-an386", &Board::mps2(), 24_000, 16);
}

#[test]
fn an_m33_as_in_qemu() {
    compare(Core::M33, "mps2-an505", &Board::mps2_an505(), 24_000, 16);
}
