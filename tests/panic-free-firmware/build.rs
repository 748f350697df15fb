//! Links without a runtime: the image is looked at, never run.
fn main() {
    println!("cargo:rustc-link-arg-bins=--entry=entry");
    println!("cargo:rustc-link-arg-bins=--gc-sections");
}
