//! decoder-core, linked whole for Cortex-M, has no panic, no float and no allocation in it. Firmware and servo-wire, linked as a
//! board links them, have no panic but those that are allowed below.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{budgets, cargo, require_target};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

/// Parts of symbol names that must not be in the image.
const FORBIDDEN: [&str; 5] = [
    // Every panic ends here.
    "9panicking",
    // Software floating point of the run-time ABI, single and double.
    "__aeabi_f",
    "__aeabi_d",
    "compiler_builtins5float",
    // The allocator.
    "__rust_alloc",
];

/// Code below this many bytes means that the optimiser folded the decoders away. They take about 27,000.
const FLOOR: u64 = 20_000;

fn image(target: &str, features: &[&str]) -> (u64, Vec<String>) {
    let path = cargo::image("panic-free", "panic-free", target, "panic-free", features);
    let bytes = std::fs::read(&path).unwrap();
    let file = object::File::parse(bytes.as_slice()).unwrap();
    let code =
        file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text).map(|symbol| symbol.size()).sum();
    let found = file
        .symbols()
        .filter_map(|symbol| symbol.name().ok().map(str::to_owned))
        .filter(|name| FORBIDDEN.iter().any(|part| name.contains(part)))
        .collect();
    (code, found)
}

/// A panic that the firmware's image may have: its name, who calls it, and why.
const ALLOWED: [(&str, &str, &str); 2] = [
    (
        "panic_const_async_fn_resumed",
        "",
        "the compiler puts it into every async fn, for who polls one that has ended; `await` and executors do not",
    ),
    (
        "panic_const_add_overflow",
        "8heapless3vec",
        "a length and that of a slice, whose sum is then compared with the capacity; boards build without this check",
    ),
];

/// Code below this many bytes means that the optimiser folded the player away. It takes about 150,000.
const FIRMWARE_FLOOR: u64 = 100_000;

/// Functions of an image: where each begins, without the bit that says Thumb, and its name.
fn functions(file: &object::File<'_>) -> Vec<(u64, String)> {
    let code = file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0);
    let mut functions: Vec<_> =
        code.filter_map(|symbol| Some((symbol.address() & !1, symbol.name().ok()?.to_owned()))).collect();
    functions.sort();
    functions
}

/// Where the branch of 32 bits in these two halfwords at `at` goes: BL, or B without a condition (ARMv7-M manual, A7.7.12 and
/// A7.7.18).
fn branch(at: u64, first: u16, second: u16) -> Option<u64> {
    if first >> 11 != 0b11110 || second & 0x9000 != 0x9000 {
        return None;
    }
    let sign = u32::from(first >> 10 & 1);
    let not_xor = |bit: u16| 1 ^ u32::from(bit & 1) ^ sign;
    let (i1, i2) = (not_xor(second >> 13), not_xor(second >> 11));
    let offset =
        sign << 24 | i1 << 23 | i2 << 22 | u32::from(first & 0x3ff) << 12 | u32::from(second & 0x7ff) << 1;
    let offset = (offset << 7).cast_signed() >> 7;
    at.checked_add_signed(i64::from(offset) + 4)
}

/// The panics of an image: each with the function that calls it.
fn panics(bytes: &[u8]) -> (u64, Vec<(String, String)>) {
    let file = object::File::parse(bytes).unwrap();
    let functions = functions(&file);
    let size =
        file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text).map(|symbol| symbol.size()).sum();
    let named = |at: u64| &functions[functions.partition_point(|(start, _)| *start <= at) - 1].1;
    let mut found = Vec::new();
    for section in file.sections().filter(|section| section.kind() == object::SectionKind::Text) {
        let data = section.data().unwrap();
        let halves: Vec<u16> =
            data.chunks_exact(2).map(|half| u16::from_le_bytes([half[0], half[1]])).collect();
        for (index, pair) in halves.windows(2).enumerate() {
            let at = section.address() + 2 * index as u64;
            let Some(target) = branch(at, pair[0], pair[1]) else { continue };
            if let Ok(place) = functions.binary_search_by_key(&target, |(start, _)| *start)
                && functions[place].1.contains("9panicking")
                && !named(at).contains("9panicking")
            {
                found.push((functions[place].1.clone(), named(at).clone()));
            }
        }
    }
    (size, found)
}

fn firmware_panics(target: &str, features: &[&str]) -> (u64, Vec<(String, String)>) {
    let name = "panic-free-firmware";
    let path = cargo::image(name, name, target, name, features);
    let (size, found) = panics(&std::fs::read(&path).unwrap());
    // The check itself sees calls: that of the async functions is always there.
    assert!(!found.is_empty(), "{target}: not even what every async fn has was found");
    let allowed = |(panic, caller): &(String, String)| {
        ALLOWED.iter().any(|(name, by, _)| panic.contains(name) && caller.contains(by))
    };
    (size, found.into_iter().filter(|call| !allowed(call)).collect())
}

fn check_firmware(target: &str) {
    if !require_target(target) {
        return;
    }
    let (size, found) = firmware_panics(target, &[]);
    assert!(found.is_empty(), "{target}: {found:#?}");
    assert!(size > FIRMWARE_FLOOR, "{target}: only {size} bytes of code");
    println!("{target}: {size} bytes of code");
    let (_, found) = firmware_panics(target, &["planted"]);
    assert!(!found.is_empty(), "{target}: the planted panic was not found");
}

#[test]
fn firmware_thumbv6m() {
    check_firmware("thumbv6m-none-eabi");
}

#[test]
fn firmware_thumbv7em() {
    check_firmware("thumbv7em-none-eabi");
}

#[test]
fn branches_are_read_as_the_manual_has_them() {
    // `bl` to itself, to the next instruction, and 16 MiB back; `b.w`; and what is neither.
    assert_eq!(branch(0x1000, 0xf7ff, 0xfffe), Some(0x1000));
    assert_eq!(branch(0x1000, 0xf000, 0xf800), Some(0x1004));
    assert_eq!(branch(0x200_0000, 0xf400, 0xd000), Some(0x100_0004));
    assert_eq!(branch(0x1000, 0xf000, 0xb800), Some(0x1004));
    assert_eq!(branch(0x1000, 0x4770, 0xf800), None);
}

fn check(target: &str) {
    if !require_target(target) {
        return;
    }
    let (code, found) = image(target, &[]);
    assert!(found.is_empty(), "{target}: {found:?}");
    assert!(code > FLOOR, "{target}: only {code} bytes of code");
    budgets::check(&[(format!("decoder-core, whole and checked: {target}, bytes of code"), code as f64)]);
    let (_, found) = image(target, &["planted"]);
    assert!(
        found.iter().any(|name| name.contains("9panicking")),
        "{target}: the planted panic was not found"
    );
}

#[test]
fn thumbv6m() {
    check("thumbv6m-none-eabi");
}

#[test]
fn thumbv7em() {
    check("thumbv7em-none-eabi");
}
