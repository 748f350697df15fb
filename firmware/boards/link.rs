//! The build script of every board: names the linker scripts. The map of the memory is memory.x in the board's folder.

#[path = "board_x.rs"]
mod board_x;

fn main() {
    board_x::lay_out(env!("CARGO_MANIFEST_DIR"));
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}
