//! Every malformed file gives one clear sentence, and never a panic.

use std::fs;
use std::path::PathBuf;

use super::{amc, asf, bvh, load};
use crate::skeleton::Skeleton;
use crate::{export, sample};

/// A skeleton and two frames of its motion in both formats.
struct Texts {
    skeleton: Skeleton,
    asf: Vec<u8>,
    amc: Vec<u8>,
    bvh: Vec<u8>,
}

impl Texts {
    fn new() -> Self {
        let mut clip = sample::clip();
        clip.motion.samples.drain(2 * clip.motion.channels..);
        let (mut amc, mut bvh) = (Vec::new(), Vec::new());
        export::amc::write(&mut amc, &clip.skeleton, &clip.motion, export::amc::Rotations::AsTheyAre)
            .expect("a Vec takes it");
        export::bvh::write(&mut bvh, &clip.skeleton, &clip.motion).expect("a Vec takes it");
        Self { asf: sample::asf().into_bytes(), amc, bvh, skeleton: clip.skeleton }
    }

    /// The error for each of the texts, if it has become one.
    fn errors(&self) -> [Option<String>; 3] {
        [
            asf::parse(&self.asf, "x.asf").err(),
            amc::parse(&self.amc, "x.amc", &self.skeleton, None).err(),
            bvh::parse(&self.bvh, "x.bvh", 1.0, None).err(),
        ]
        .map(|error| error.map(|error| error.to_string()))
    }
}

fn assert_sentence(error: &str) {
    assert!(error.starts_with("x."), "{error}");
    assert!(error.contains(": found ") && error.contains(", expected "), "{error}");
    assert!(error.len() < 300 && !error.contains(['\n', '\r', '\0']), "{error}");
}

#[test]
fn cut_anywhere() {
    let whole = Texts::new();
    assert_eq!(whole.errors(), [None, None, None]);
    let longest = whole.asf.len().max(whole.amc.len()).max(whole.bvh.len());
    for cut in 0..longest {
        let head = |text: &[u8]| text[..cut.min(text.len())].to_vec();
        let [asf, amc, bvh] = [&whole.asf, &whole.amc, &whole.bvh].map(|text| head(text));
        let part = Texts { skeleton: whole.skeleton.clone(), asf, amc, bvh };
        let errors = part.errors();
        errors.iter().flatten().for_each(|error| assert_sentence(error));
        // What a file without its last digits is, no reader can tell; anything shorter is wrong. An AMC file
        // may end after any of its frames.
        let last_number = whole.bvh.trim_ascii_end().iter().rposition(|byte| *byte == b' ').expect("numbers");
        // Where a BVH file ends behind a row, the rows are not as many as its header says.
        if cut <= last_number && errors[2].is_none() {
            let notes = bvh::parse(&part.bvh, "x.bvh", 1.0, None).expect("no error").notes;
            assert_eq!(
                notes,
                ["the header says 2 frames, the file has 1 rows: these are the frames"],
                "{cut}"
            );
        }
        if cut + "    root rhipjoint\n  end\n".len() < whole.asf.len() {
            assert!(errors[0].is_some(), "ASF cut at {cut}");
        }
    }
}

#[test]
fn changed_anywhere() {
    let whole = Texts::new();
    let mut seed = 0x2545_f491_4f6c_dd1d_u64;
    let mut random = move |below: usize| {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed % below as u64) as usize
    };
    let bytes = b"\0\n\r\t #:{}()-+.eE019xX\x7f\xff";
    for _ in 0..4000 {
        let mut change = |text: &[u8]| {
            let mut text = text.to_vec();
            for _ in 0..=random(3) {
                let at = random(text.len());
                match random(4) {
                    0 => text[at] = bytes[random(bytes.len())],
                    1 => text.insert(at, bytes[random(bytes.len())]),
                    2 => drop(text.remove(at)),
                    _ => {
                        // A part of the file a second time, elsewhere.
                        let part: Vec<u8> = text[at..].iter().take(random(200)).copied().collect();
                        let to = random(text.len());
                        drop(text.splice(to..to, part));
                    }
                }
            }
            text
        };
        let [asf, amc, bvh] = [&whole.asf, &whole.amc, &whole.bvh].map(|text| change(text));
        let changed = Texts { skeleton: whole.skeleton.clone(), asf, amc, bvh };
        changed.errors().iter().flatten().for_each(|error| assert_sentence(error));
    }
}

#[test]
fn wrong_files_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let texts = Texts::new();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).expect("a writable folder");
        path
    };
    let jpeg = b"\xff\xd8\xff\xe0\x00\x10JFIF\x00\x01\x01\x00\x00\x01\x00\x01\x00\x00";
    let asf = write("good.asf", &texts.asf);
    let picture = write("picture.asf", jpeg);
    let message = |path: &PathBuf, skeleton: Option<&PathBuf>| {
        let error = load(path, skeleton.map(PathBuf::as_path), None).expect_err("a wrong file").to_string();
        error.replace(&folder.path().display().to_string(), "")
    };
    let amc = write("a.amc", &texts.amc);
    for (path, skeleton, expected) in [
        (
            write("jpeg.bvh", jpeg),
            None,
            "/jpeg.bvh: found byte 0x00 at offset 4, which is not text, expected a BVH file",
        ),
        (
            write("jpeg.amc", jpeg),
            Some(&asf),
            "/jpeg.amc: found byte 0x00 at offset 4, which is not text, expected an AMC file",
        ),
        (
            write("jpeg.jpg", jpeg),
            None,
            "/jpeg.jpg: found byte 0x00 at offset 4, which is not text, expected an AMC, BVH, CSV, GLB or JSON file",
        ),
        (write("empty.bvh", b""), None, "/empty.bvh: found an empty file, expected a BVH file"),
        (
            write("empty", b" \r\n\n"),
            None,
            "/empty: found an empty file, expected an AMC, BVH, CSV, GLB or JSON file",
        ),
        (
            write("text.txt", b"hello"),
            None,
            "/text.txt: found something else, expected an AMC, BVH, CSV, GLB or JSON file",
        ),
        (
            amc.clone(),
            None,
            "/a.amc: found no skeleton for this AMC file, expected its ASF file (--skeleton NAME.asf)",
        ),
        (
            amc.clone(),
            Some(&picture),
            "/picture.asf: found byte 0x00 at offset 4, which is not text, expected an ASF file",
        ),
        (amc.clone(), Some(&amc), "/a.amc, line 36: found the end of the file, expected a section `:root`"),
        (asf.clone(), None, "/good.asf: found a skeleton (ASF), expected an AMC, BVH, CSV, GLB or JSON file"),
        (folder.path().join("none.bvh"), None, "cannot read /none.bvh: No such file or directory"),
    ] {
        let error = message(&path, skeleton);
        assert!(error.starts_with(expected), "{error}");
    }
    let cut = write("cut.bvh", &texts.bvh[..texts.bvh.len() / 2]);
    assert!(message(&cut, None).starts_with("/cut.bvh, line "));
    assert!(load(&amc, Some(&asf), Some(f64::NAN)).is_err());
    assert!(load(&amc, Some(&asf), Some(0.0)).is_err());
    assert!(load(&write("upper.AMC", &texts.amc), Some(&asf), None).is_ok());
    assert!(load(&write("no-extension", &texts.bvh), None, None).is_ok());
}
