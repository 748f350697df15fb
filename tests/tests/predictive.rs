//! The document's predictive methods (sections 7.2 to 7.6) on real motion, as a user reproduces them.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, motion, trials};
use encoder::codec::adpcm::{Adpcm, StepAdaptation};
use encoder::mclip::Encoder;
use encoder::train::{Search, jayant, scores, train};
use serde_json::Value;
use std::path::PathBuf;

#[test]
fn adaptive_prediction_with_huffman_is_five_to_one_at_30_db_on_every_clip() {
    let Some(trials) = trials() else { return };
    let clips: Vec<PathBuf> = trials.into_iter().map(|(motion, _)| motion).collect();
    let output = bunraku().arg("rd").args(&clips).args(["--fps", "30", "--psnr", "30", "--json"]).output();
    let output = output.unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = report["clips"].as_array().unwrap();
    let of = |method: &str| {
        let rows: Vec<&Value> = rows.iter().filter(|row| row["method"] == method).collect();
        assert_eq!(rows.len(), clips.len(), "{method}");
        rows
    };
    for method in ["even steps, adaptive", "even steps, window of 15", "even steps, window of 120"] {
        for row in of(method) {
            let [psnr, ratio] = ["psnr_db", "ratio"].map(|key| row[key].as_f64().unwrap());
            assert!(psnr >= 30.0 && ratio >= 5.0, "{row}");
        }
    }
    // The document's order: direct quantisation needs most, prediction less, and Huffman codes less again.
    let needed = |method: &str| {
        let pooled = report["order"].as_array().unwrap().iter().find(|row| row["method"] == method).unwrap();
        assert_eq!(pooled["missed"], 0, "{pooled}");
        pooled["bits_per_s_at"].as_f64().unwrap()
    };
    assert!(needed("direct") > needed("predictive"));
    assert!(needed("direct, Huffman") > needed("predictive, Huffman"));
    assert!(needed("direct") > needed("adaptive predictive"));
    assert!(needed("predictive") > needed("predictive, Huffman"));
    assert!(needed("adaptive predictive") > needed("adaptive predictive, Huffman"));
    // Max's quantiser is the best for codes of fixed width, where differences are peaked.
    assert!(needed("differences, uniform") > needed("differences, Laplacian Max"));
}

/// The multipliers of the table against Jayant's, on clips that the table was not trained on.
#[test]
fn trained_multipliers_beat_jayants_on_clips_held_out() {
    let Some(folder) = motion() else { return };
    let clips: Vec<_> = ["02_01", "05_03", "16_46"]
        .iter()
        .map(|name| {
            let file = |name: &str| folder.join("cmu").join(name);
            let subject = name.split('_').next().unwrap();
            let skeleton = file(&format!("{subject}.asf"));
            mocap::import::load(&file(&format!("{name}.amc")), Some(&skeleton), None).unwrap()
        })
        .collect();
    let encoders: Vec<Encoder> =
        clips.iter().map(|clip| Encoder::new(&clip.skeleton, &clip.motion).unwrap()).collect();
    let mut saved = 0.0;
    for bits in 2..=6 {
        let [ours, his] = [StepAdaptation::trained(bits), jayant(bits)].map(|steps| {
            let scores = scores(&encoders, Adpcm::BOTH, bits, steps).unwrap();
            scores.iter().map(|score| score.rms_cm.log2()).sum::<f64>() / scores.len() as f64
        });
        println!("{bits} bits: error 2^{ours:.3} cm, with Jayant's multipliers 2^{his:.3}");
        saved += (his - ours) / 5.0;
    }
    assert!(saved > 0.05, "{saved} bits");
    // And a table for one motion is better on it than any other.
    let own = train(&encoders[2..], Adpcm::BOTH, 4, Search::All).unwrap();
    let [own, his] =
        [own, jayant(4)].map(|steps| scores(&encoders[2..], Adpcm::BOTH, 4, steps).unwrap()[0].rms_cm);
    assert!(own < his, "{own} {his}");
}
