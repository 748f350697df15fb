//! A wearable sleeps: 20 outputs at 30 Hz keep a Cortex-M4 at 64 MHz awake for at most 0.2 % of the time.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{budgets, bunraku, motion, require_target, workspace};
use std::process::Output;

#[test]
fn twenty_outputs_are_awake_for_two_thousandths_of_the_time() {
    let Some(folder) = motion().filter(|_| require_target("thumbv7em-none-eabi")) else { return };
    let folder = folder.join("cmu");
    let temporary = tempfile::tempdir().unwrap();
    let clip = temporary.path().join("walk.qmd");
    let skeleton = folder.join("02.asf");
    let mut encode = bunraku();
    encode.arg("encode").arg(folder.join("02_01.amc")).arg("--skeleton").arg(&skeleton).arg("-o").arg(&clip);
    assert!(encode.status().unwrap().success());
    let wear = |arguments: &[&str]| {
        let puppet = workspace().join("puppets/cmu-20.toml");
        let mut command = bunraku();
        command.arg("wearable").arg(&clip).arg("--puppet").arg(puppet).arg("--skeleton").arg(&skeleton);
        command.args(arguments).output().unwrap()
    };

    let Output { status, stdout, stderr } = wear(&["--most", "0.2", "--json"]);
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    let report: serde_json::Value = serde_json::from_slice(&stdout).unwrap();
    // 343 frames at 120 Hz, from the first one's outputs to those of the next round.
    assert_eq!((report["outputs"].as_u64(), report["ticks"].as_u64()), (Some(20), Some(86)));
    let (awake, cycles) = (report["awake"].as_f64().unwrap(), report["cycles_mean"].as_f64().unwrap());
    assert!(awake > 0.0 && awake <= 0.002, "{report}");
    budgets::check(&[("qmd: cortex-m4, wearable of 20 outputs, mean cycles of a tick".to_owned(), cycles)]);
    // SysTick wakes it 30 times a second.
    assert!((cycles * 30.0 / 64e6 - awake).abs() < 1e-6, "{report}");

    let Output { status, stderr, .. } = wear(&["--most", "0.1"]);
    let said = String::from_utf8(stderr).unwrap();
    assert_eq!(status.code(), Some(1), "{said}");
    assert!(said.contains("expected at most 0.1 %"), "{said}");
}
