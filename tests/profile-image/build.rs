//! Lays the images out as those of QEMU's board: flash at 0, RAM at 0x2000_0000, 4 MiB of each.

#[path = "../../firmware/boards/board_x.rs"]
mod board_x;

fn main() {
    board_x::lay_out(concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware/boards/qemu-mps2"));
    for argument in ["--nmagic", "-Tlink.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}
