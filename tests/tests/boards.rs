//! What the images of all boards take of flash and RAM, with the embedded clip.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{budgets, bunraku, require_target};
use serde_json::Value;

/// Every image is linked by one thread, which takes minutes; `cargo xtask boards` and `.ci/run images` run this.
#[test]
#[ignore = "cargo xtask boards runs it"]
fn images_take_as_much_flash_and_ram_as_they_may() {
    if !["thumbv6m-none-eabi", "thumbv7em-none-eabi", "thumbv8m.main-none-eabi"]
        .iter()
        .all(|target| require_target(target))
    {
        return;
    }
    let output = bunraku().args(["image", "--board", "all", "--json"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let sizes: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    assert!(sizes.len() >= 5, "{sizes:?}");
    let mut measured = Vec::new();
    for size in &sizes {
        let name = size["board"].as_str().unwrap();
        let bytes = |keys: [&str; 2]| keys.iter().map(|key| size[key].as_f64().unwrap()).sum::<f64>();
        measured.push((format!("image of {name}, bytes of flash"), bytes(["text", "data"])));
        measured.push((format!("image of {name}, bytes of RAM without stack"), bytes(["data", "bss"])));
    }
    budgets::check(&measured);
}
