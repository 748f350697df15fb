//! Names the linker scripts.

#[path = "../../firmware/boards/board_x.rs"]
mod board_x;

fn main() {
    let folder = env!("CARGO_MANIFEST_DIR");
    println!("cargo:rerun-if-changed={folder}/microbit.x");
    // memory.x, of QEMU's mps2, is that of the M4 and the M3 board.
    board_x::lay_out(&format!("{folder}/../../firmware/boards/qemu-mps2"));
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    if std::env::var("TARGET").is_ok_and(|target| target.starts_with("thumbv6m")) {
        println!("cargo:rustc-link-arg-bins=-T{folder}/microbit.x");
    }
}
