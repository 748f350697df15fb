//! Whole images end alike on the simulated core and under QEMU: registers, flags, all of RAM, and the bytes on the
//! UART.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{cargo, require_program, require_target, vectors, workspace};
use host_sim::{board, qemu};
use puppet_file::Puppet;
use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use thumb_cycles::{Board, Core, Image, Machine, Stop};
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::virtual_bus::VirtualBus;

/// More than any of these takes, in cycles and in time.
const CYCLES: u64 = 10_000_000_000;
const TIME: Duration = Duration::from_secs(120);

/// The flags in the xPSR: N, Z, C, V, Q and GE.
const FLAGS: u32 = 0xf80f_0000;

/// Semihosting operations that end an image.
const EXITS: [u32; 2] = [0x18, 0x20];

/// Where an image ended: r0 to r15, the flags, and RAM.
#[derive(PartialEq, Eq)]
struct End {
    registers: [u32; 16],
    flags: u32,
    ram: Vec<u8>,
}

/// GDB's remote protocol, as much as it takes to stop QEMU somewhere and look.
struct Gdb {
    qemu: Child,
    stream: TcpStream,
}

impl Gdb {
    /// Starts the image in `folder`, stopped before its first instruction.
    fn start(machine: &str, image: &Path, argument: &str, folder: &Path) -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let qemu = Command::new("qemu-system-arm")
            .args(["-machine", machine, "-display", "none", "-monitor", "none", "-serial", "null"])
            .args(["-semihosting-config", &format!("enable=on,target=native,arg={argument}")])
            .args(["-S", "-gdb", &format!("tcp:127.0.0.1:{port}"), "-kernel"])
            .arg(image)
            .current_dir(folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let deadline = Instant::now() + TIME;
        let stream = loop {
            match TcpStream::connect(("127.0.0.1", port)) {
                Ok(stream) => break stream,
                Err(error) => assert!(Instant::now() < deadline, "QEMU's gdb port: {error}"),
            }
            sleep(Duration::from_millis(20));
        };
        stream.set_read_timeout(Some(TIME)).unwrap();
        stream.set_nodelay(true).unwrap();
        Self { qemu, stream }
    }

    fn byte(&mut self) -> u8 {
        let mut byte = [0];
        self.stream.read_exact(&mut byte).unwrap();
        byte[0]
    }

    /// The next packet.
    fn packet(&mut self) -> String {
        while self.byte() != b'$' {}
        let mut text = String::new();
        loop {
            match self.byte() {
                b'#' => break,
                byte => text.push(char::from(byte)),
            }
        }
        // The checksum; TCP has its own.
        let _ = (self.byte(), self.byte());
        self.stream.write_all(b"+").unwrap();
        text
    }

    fn ask(&mut self, text: &str) -> String {
        let sum = text.bytes().fold(0u8, u8::wrapping_add);
        self.stream.write_all(format!("${text}#{sum:02x}").as_bytes()).unwrap();
        self.packet()
    }

    fn bytes(&mut self, text: &str) -> Vec<u8> {
        let answer = self.ask(text);
        let pairs = answer.as_bytes().chunks_exact(2);
        pairs.map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
    }

    /// r0 to r15, then registers of an FPU that no board has, and last the xPSR.
    fn registers(&mut self) -> Vec<u32> {
        let bytes = self.bytes("g");
        bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect()
    }

    /// Runs to where the image ends itself by the BKPT at `address`.
    fn run_to_exit(&mut self, address: u32) -> Vec<u32> {
        assert_eq!(self.ask(&format!("Z0,{address:x},2")), "OK");
        loop {
            let stopped = self.ask("c");
            assert!(stopped.starts_with("T05"), "QEMU stopped with {stopped}");
            let registers = self.registers();
            if EXITS.contains(&registers[0]) {
                return registers;
            }
            // A breakpoint that is here does not stop at once again.
            assert_eq!(self.ask(&format!("z0,{address:x},2")), "OK");
            assert!(self.ask("s").starts_with("T05"));
            assert_eq!(self.ask(&format!("Z0,{address:x},2")), "OK");
        }
    }

    fn memory(&mut self, address: u32, len: usize) -> Vec<u8> {
        const PART: usize = 0x400;
        let parts = (0..len).step_by(PART);
        parts.flat_map(|at| self.bytes(&format!("m{:x},{PART:x}", address as usize + at))).collect()
    }
}

impl Drop for Gdb {
    fn drop(&mut self) {
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// Runs the image here to the BKPT with which it ends itself.
fn here(core: Core, board: &Board, elf: &[u8], clip: &[u8]) -> (End, Machine) {
    let image = Image::parse(elf).unwrap();
    let start = || {
        let mut machine = Machine::new(core, board, &image).unwrap();
        machine.semihosting.files.insert("clip".to_owned(), clip.to_vec());
        machine.semihosting.command_line = "clip".to_owned();
        machine
    };
    // Where that is shows a first run.
    let mut machine = start();
    while !matches!(machine.run_until(CYCLES).unwrap_or_else(|fault| panic!("{fault}")), Stop::Exit(_)) {}
    let exit = machine.cpu.pc - 2;
    let mut machine = start();
    machine.set_breakpoint(exit);
    loop {
        assert_eq!(machine.run_until(CYCLES).unwrap(), Stop::Breakpoint(exit));
        if EXITS.contains(&machine.cpu.r[0]) {
            break;
        }
    }
    let mut registers = machine.cpu.r;
    registers[15] = machine.cpu.pc;
    let ram = machine.memory().regions()[1].data.clone();
    (End { registers, flags: machine.cpu.xpsr() & FLAGS, ram }, machine)
}

fn compare(core: Core, name: &str, board: &Board, binary: &str) {
    if !require_target(core.target()) || !require_program("qemu-system-arm") {
        return;
    }
    let path = cargo::image("on-target", binary, core.target(), "firmware", &[]);
    let elf = fs::read(&path).unwrap();
    let clip = vectors::all().remove(0).bytes;
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("clip"), &clip).unwrap();

    let (ours, machine) = here(core, board, &elf, &clip);
    let mut gdb = Gdb::start(name, &path, "clip", folder.path());
    let registers = gdb.run_to_exit(ours.registers[15]);
    let base = machine.memory().regions()[1].base;
    let ram = gdb.memory(base, ours.ram.len());
    let theirs = End {
        registers: registers[..16].try_into().unwrap(),
        flags: registers[registers.len() - 1] & FLAGS,
        ram,
    };
    let instructions = machine.usage().instructions;
    assert_eq!(
        ours.registers.map(Hex),
        theirs.registers.map(Hex),
        "registers after {instructions} instructions"
    );
    assert_eq!(ours.flags, theirs.flags, "flags after {instructions} instructions");
    if let Some(at) = ours.ram.iter().zip(&theirs.ram).position(|(ours, theirs)| ours != theirs) {
        panic!("RAM at {:#010x} after {instructions} instructions", base as usize + at);
    }
    assert_eq!(ours.ram.len(), theirs.ram.len());
    println!(
        "{}: {binary} ends as in QEMU's {name} after {instructions} instructions, {} KB of RAM alike",
        core.name(),
        ours.ram.len() >> 10
    );
}

/// A register, shown as hexadecimal digits.
#[derive(PartialEq, Eq)]
struct Hex(u32);

impl std::fmt::Debug for Hex {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:#010x}", self.0)
    }
}

#[test]
fn an_m0_ends_as_in_qemu() {
    compare(Core::M0, "microbit", &Board::microbit(), "stream");
}

#[test]
fn an_m3_ends_as_in_qemu() {
    compare(Core::M3, "mps2-an385", &Board::mps2(), "in-place");
}

#[test]
fn an_m4_ends_as_in_qemu() {
    compare(Core::M4, "mps2-an386", &Board::mps2(), "in-place");
}

/// The board that plays: interrupts, sleep, and a UART. When an interrupt comes differs, so registers do.
#[test]
fn the_board_sends_the_same_bytes_as_in_qemu() {
    if !require_target("thumbv7em-none-eabi") || !require_program("qemu-system-arm") {
        return;
    }
    let clip = vectors::with_trials().into_iter().find(|vector| vector.name == "sample").unwrap();
    let path = workspace().join("puppets/sample.toml");
    // Its servos stand still here, which is a fault where following errors are looked at.
    let text = fs::read_to_string(&path).unwrap().replacen("servo_hz", "following_error = 0\nservo_hz", 1);
    let puppet = Puppet::parse(&path, text).unwrap();
    let map = puppet.map(&mocap::sample::clip().skeleton).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("board");
    let elf = board::QEMU_MPS2.build(&clip.bytes, &map, 0).unwrap();
    fs::write(&path, &elf).unwrap();

    // Servos that answer alike: their time stands still.
    let servos = || {
        let ids: Vec<u8> = map.joints().iter().map(|joint| joint.id).collect();
        DynamixelServos::new(&DynamixelConfig::with_ids(&ids)).unwrap()
    };
    let (mut theirs, mut their_servos) = (Vec::new(), servos());
    let image = qemu::Image { path: &path, machine: board::QEMU_MACHINE, arguments: &[] };
    let mut device = |bytes: &[u8]| {
        theirs.extend_from_slice(bytes);
        their_servos.receive(bytes, 0, &mut |_| {})
    };
    qemu::run_image(&image, Some(&mut device), TIME, &mut |_| {}).unwrap();

    let image = Image::parse(&elf).unwrap();
    let mut machine = Machine::new(Core::M4, &Board::mps2(), &image).unwrap();
    let (mut ours, mut our_servos) = (Vec::new(), servos());
    let mut device = |bytes: &[u8]| {
        ours.extend_from_slice(bytes);
        our_servos.receive(bytes, 0, &mut |_| {})
    };
    let code =
        machine.run_to_exit(&mut device, &mut |_| {}, CYCLES).unwrap_or_else(|fault| panic!("{fault}"));
    assert_eq!(code, Some(0));
    assert!(!ours.is_empty());
    assert!(ours == theirs, "{} bytes here, {} in QEMU", ours.len(), theirs.len());
    let usage = machine.usage();
    assert!(usage.asleep > usage.cycles / 2, "{usage:?}");
    println!("cortex-m4: the board sends the {} bytes that it sends in QEMU; {usage:?}", ours.len());
}
