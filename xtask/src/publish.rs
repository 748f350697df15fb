//! `cargo xtask publish-check` and `cargo xtask api`: whether the crates that are for others could be published, and what they
//! have for them.

use crate::{Result, cargo, run};

/// Packages and builds every crate of the workspace whose manifest does not say `publish = false`, as for the registry.
/// Nothing is uploaded.
pub fn check() -> Result<()> {
    run(cargo().args(["publish", "--workspace", "--dry-run", "--allow-dirty"]))
}

/// Writes docs/api anew: the public items of those crates.
pub fn write_api() -> Result<()> {
    run(cargo().env("BUNRAKU_BLESS", "1").args([
        "test",
        "--quiet",
        "--package",
        "xtask",
        "--test",
        "api_snapshot",
    ]))
}
