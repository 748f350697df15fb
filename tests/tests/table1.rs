//! The figures of the QMD paper on the trials behind them, as a user reproduces them.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, motion};
use serde_json::Value;

fn json(arguments: &[&str]) -> Value {
    let output = bunraku().args(arguments).arg("--json").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn sizes_are_the_papers_and_our_error_is_a_twentieth_of_the_faithful_encoders() {
    let Some(motion) = motion() else { return };
    let folder = motion.join("cmu");
    let rows = json(&["table1", "--motion", folder.to_str().unwrap()]);
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), 6);
    for row in rows {
        let frames = row["frames"].as_u64().unwrap();
        assert_eq!(row["bytes"].as_u64().unwrap(), 1037 + 5 * 62 + frames * (4 * 6 + 62 - 6), "{row}");
        let kib = row["bytes"].as_f64().unwrap() / 1024.0;
        assert!((kib - row["paper_kib"].as_f64().unwrap()).abs() < 0.051, "{row}");
        let [faithful, ours] =
            ["faithful_mean_joint_cm", "mean_joint_cm"].map(|key| row[key].as_f64().unwrap());
        assert!(ours > 0.0 && ours * 20.0 <= faithful, "{row}");
    }
}

/// The paper's own sizes are checked above, so percentages of them are of figures that were printed.
#[test]
fn packed_indices_take_a_fifth_of_the_papers_bytes() {
    let Some(motion) = motion() else { return };
    let folder = motion.join("cmu");
    let rows = json(&["table1", "--packed", "--motion", folder.to_str().unwrap()]);
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), 6);
    for row in rows {
        let frames = row["frames"].as_u64().unwrap();
        let paper = 1037 + 5 * 62 + frames * (4 * 6 + 62 - 6);
        assert_eq!(row["paper_bytes"].as_u64().unwrap(), paper, "{row}");
        let faithful = row["faithful_mean_joint_cm"].as_f64().unwrap();
        for (point, percent, cm) in [("packed", 20, faithful), ("fine", 35, 0.45)] {
            let point = &row[point];
            let bytes = point["bytes"].as_u64().unwrap();
            assert!(bytes * 100 <= paper * percent, "{row}");
            let found = point["mean_joint_cm"].as_f64().unwrap();
            assert!(found > 0.0 && found <= cm, "{row}");
            // Names, ranges and steps of 62 channels, and the tables.
            assert!(point["header_bytes"].as_u64().unwrap() < 700, "{row}");
        }
    }
}

#[test]
fn the_pruned_search_finds_the_optimum_with_a_tenth_of_the_encodes() {
    let Some(motion) = motion() else { return };
    // The two longest trials take minutes: `bunraku optimize --exhaustive` does them by hand.
    for (trial, subject) in [("16_46", "16"), ("49_04", "49"), ("02_02", "02"), ("02_01", "02")] {
        let [input, skeleton] = [format!("cmu/{trial}.amc"), format!("cmu/{subject}.asf")]
            .map(|name| motion.join(name).to_str().unwrap().to_owned());
        for method in [&[][..], &["--faithful"]] {
            let mut arguments = vec!["optimize", &input, "--skeleton", &skeleton];
            arguments.extend(method);
            let pruned = json(&arguments);
            arguments.push("--exhaustive");
            let exhaustive = json(&arguments);
            assert_eq!(pruned["best"], exhaustive["best"], "{arguments:?}");
            let [few, all] = [&pruned, &exhaustive].map(|report| report["encodes"].as_u64().unwrap());
            assert_eq!(pruned["exhaustive_encodes"].as_u64(), Some(all));
            assert!(few * 10 <= all, "{arguments:?}: {few} of {all} encodes");
        }
    }
}
