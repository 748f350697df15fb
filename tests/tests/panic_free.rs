//! decoder-core, linked whole for Cortex-M, has no panic, no float and no allocation in it.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{budgets, cargo, require_target};
use object::{Object, ObjectSymbol, SymbolKind};

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
