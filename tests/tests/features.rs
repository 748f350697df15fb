//! decoder-core with each of its features alone, with none and with all: what it was built without is refused by name, and
//! all else is decoded.

use bunraku_tests::workspace;
use decoder_core::mclip::{CodecId, EntropyId};
use std::process::Command;

/// Sets of features, by the lists of codecs and entropy stages.
fn sets() -> Vec<Vec<&'static str>> {
    let codecs: Vec<&str> =
        CodecId::ALL.into_iter().flat_map(|codec| [&[codec.name()], codec.parts()].concat()).collect();
    let stages = EntropyId::ALL.map(EntropyId::name).to_vec();
    let mut sets = vec![Vec::new(), [codecs.clone(), stages.clone()].concat()];
    // A codec decodes nothing without a stage, nor a stage without a codec: so each alone, and with all of the others. Of a
    // codec with parts, all vectors need one of them.
    sets.extend(codecs.iter().map(|&codec| vec![codec]));
    for codec in CodecId::ALL {
        let own = if codec.parts().is_empty() { &[codec.name()] } else { codec.parts() };
        sets.extend(own.iter().map(|&name| [&[name], stages.as_slice()].concat()));
    }
    for &stage in &stages {
        sets.extend([vec![stage], [&[stage], codecs.as_slice()].concat()]);
    }
    sets
}

/// The numbers of clips that were decoded and refused, as the test `linked` prints them.
fn counts(said: &str) -> Option<(u32, u32)> {
    // The test runner's dots for tests that ended may stand before the line.
    let line = said.lines().find_map(|line| line.trim_start_matches('.').strip_suffix(" refused"))?;
    let (decoded, refused) = line.split_once(" decoded, ")?;
    Some((decoded.parse().ok()?, refused.parse().ok()?))
}

#[test]
fn every_set_of_features_decodes_what_it_has_and_refuses_the_rest() {
    let sets = sets();
    let all = sets.iter().map(Vec::len).max().unwrap_or(0);
    for set in sets {
        let output = Command::new(env!("CARGO"))
            .current_dir(workspace())
            .args(["test", "--quiet", "--package", "decoder-core", "--test", "linked"])
            .args(["--no-default-features", "--target-dir", "target/features", "--features", &set.join(",")])
            .args(["--", "--nocapture"])
            .output()
            .expect("cargo runs this test");
        let said = String::from_utf8_lossy(&output.stdout);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{set:?}: {said}\n{errors}");
        assert!(!errors.contains("warning"), "{set:?}: {errors}");
        let (decoded, refused) = counts(&said).unwrap_or_else(|| panic!("{set:?}: {said}"));
        println!("{set:?}: {decoded} decoded, {refused} refused");
        assert_eq!(refused == 0, set.len() == all, "{set:?}");
        assert_eq!(decoded == 0, set.len() < 2, "{set:?}");
    }
}
