//! `cargo xtask`: the development commands of the workspace.
fn main() {}
