//! Names the linker script of the board that the target stands for.
fn main() {
    let folder = env!("CARGO_MANIFEST_DIR");
    let target = std::env::var("TARGET").unwrap_or_default();
    let board = match target.split('-').next() {
        Some("thumbv6m") => "microbit.x",
        Some("thumbv8m.main") => "mps2-an505.x",
        _ => "mps2.x",
    };
    println!("cargo::rustc-check-cfg=cfg(thumb2, dsp, v8m)");
    let features: &[&str] = match target.split('-').next() {
        Some("thumbv7m") => &["thumb2"],
        Some("thumbv7em") => &["thumb2", "dsp"],
        Some("thumbv8m.main") => &["thumb2", "dsp", "v8m"],
        _ => &[],
    };
    for feature in features {
        println!("cargo::rustc-cfg={feature}");
    }
    println!("cargo:rerun-if-changed={folder}");
    println!("cargo:rustc-link-search={folder}");
    println!("cargo:rustc-link-arg-bins=-T{board}");
    println!("cargo:rustc-link-arg-bins=--nmagic");
}
