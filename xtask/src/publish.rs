//! `cargo xtask publish-check`: whether the crates that are for others could be published.

use crate::{Result, cargo, run};

/// Packages and builds every crate of the workspace whose manifest does not say `publish = false`, as for the registry.
/// Nothing is uploaded.
pub fn check() -> Result<()> {
    run(cargo().args(["publish", "--workspace", "--dry-run", "--allow-dirty"]))
}
