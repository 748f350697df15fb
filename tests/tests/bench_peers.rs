//! `bunraku bench peers` on the embedded sample.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, require_target};
use serde_json::Value;

#[test]
fn every_way_to_store_the_sample_is_played_and_compared() {
    if !require_target("thumbv6m-none-eabi") || !require_target("thumbv7em-none-eabi") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let plot = folder.path().join("peers.svg");
    let output = bunraku().args(["bench", "peers", "--json", "--plot"]).arg(&plot).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let entries = report["entries"].as_array().unwrap();
    let entry = |name: &str| entries.iter().find(|entry| entry["name"] == name).unwrap();
    // Two bytes a value.
    assert_eq!(entry("raw")["bytes"], 480 * 31 * 2);
    for name in ["heatshrink", "lz4_flex", "miniz_oxide", "delta + miniz_oxide"] {
        assert!(entry(name)["bytes"].as_u64() < entry("raw")["bytes"].as_u64(), "{name}");
        assert_eq!(entry(name)["mean_joint_cm"], entry("raw")["mean_joint_cm"], "{name}");
    }
    let cycles = |name: &str, core: usize| entry(name)["costs"][core]["cycles_mean"].as_f64().unwrap();
    for core in 0..2 {
        assert!(cycles("QMD, FDF 6", core) < cycles("miniz_oxide", core));
        assert!(cycles("QMD, FDF 0", core) < cycles("QMD, FDF 6", core));
    }
    let svg = std::fs::read_to_string(plot).unwrap();
    assert!(entries.iter().all(|entry| svg.contains(entry["name"].as_str().unwrap())));
}
