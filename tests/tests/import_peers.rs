//! Import and forward kinematics against files and programs that are not ours.

use std::path::{Path, PathBuf};
use std::process::Command;

use bunraku_tests::{motion, python, trials, workspace};
use mocap::Clip;
use mocap::import::{self, bvh};
use mocap::kinematics::Kinematics;
use mocap::{Skeleton, export, sample};

const ALLOWED: f64 = 1e-3;

fn load((path, skeleton): &(PathBuf, PathBuf)) -> Clip {
    import::load(path, Some(skeleton), None).unwrap_or_else(|error| panic!("{error}"))
}

fn joint(skeleton: &Skeleton, name: &str) -> usize {
    let found = skeleton.joints.iter().position(|joint| joint.name == name);
    found.unwrap_or_else(|| panic!("no joint {name}"))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// A new largest value: NaN, too, is larger.
fn raise(largest: &mut f64, value: f64) {
    if value > *largest || value.is_nan() {
        *largest = value;
    }
}

#[test]
fn trials_have_their_known_sizes() {
    let Some(trials) = trials() else { return };
    // Table 1 of the QMD paper has the numbers of frames of its motions.
    let known = [
        ("16_46", 136),
        ("49_04", 251),
        ("02_02", 298),
        ("02_01", 343),
        ("05_03", 434),
        ("02_07", 2251),
        // The one that `cargo xtask setup` fetches.
        ("01_01", 2751),
    ];
    for trial in trials {
        let clip = load(&trial);
        let name = trial.0.file_stem().and_then(|name| name.to_str()).expect("a name");
        assert_eq!((clip.skeleton.joints.len(), clip.motion.channels), (31, 62), "{name}");
        assert_eq!(clip.motion.fps, 120.0, "{name}");
        if let Some((_, frames)) = known.iter().find(|(known, _)| *known == name) {
            assert_eq!(clip.motion.frames(), *frames, "{name}");
        }
        let levels: Vec<u8> = clip.skeleton.joints.iter().map(|joint| joint.level).collect();
        let level = |name| levels[joint(&clip.skeleton, name)];
        assert_eq!(
            (level("root"), level("lhipjoint"), level("lfemur"), level("ltoes")),
            (1, 1, 2, 5),
            "{name}"
        );
    }
}

#[test]
fn amc_files_come_back_digit_by_digit() {
    let Some(trials) = trials() else { return };
    for trial in trials {
        let clip = load(&trial);
        let mut out = Vec::new();
        export::amc::write(&mut out, &clip.skeleton, &clip.motion, export::amc::Rotations::AsTheyAre)
            .unwrap_or_else(|error| panic!("{error}"));
        let ours = String::from_utf8(out).expect("text");
        let theirs = std::fs::read_to_string(&trial.0).expect("a readable file");
        let body = |line: &&str| !line.starts_with(['#', ':']);
        let (mut ours, mut theirs) = (ours.lines().filter(body), theirs.lines().filter(body));
        let mut bones = 0;
        // Within a frame the order of the bones is the file's own.
        while let (Some(number), Some(ours_number)) = (theirs.next(), ours.next()) {
            assert_eq!(number.trim(), ours_number.trim());
            let sorted = |lines: &mut dyn Iterator<Item = &str>| {
                let mut block: Vec<Vec<String>> =
                    lines.take(29).map(|line| line.split_whitespace().map(plain).collect()).collect();
                block.sort();
                block
            };
            let (theirs, ours) = (sorted(&mut theirs), sorted(&mut ours));
            assert_eq!(theirs, ours, "{} frame {number}", trial.0.display());
            bones += theirs.len();
        }
        assert_eq!(bones, 29 * clip.motion.frames());
        assert!(theirs.next().is_none() && ours.next().is_none());
    }
}

/// A number without its notation: digits and power of ten; other words as they are.
fn plain(word: &str) -> String {
    word.parse::<f64>().map_or_else(|_| word.to_string(), |value| format!("{value:e}"))
}

/// Joints of cgspeed's BVH conversion and the bone of the ASF file that ends there.
const CGSPEED: [(&str, &str); 30] = [
    ("LeftUpLeg", "lhipjoint"),
    ("LeftLeg", "lfemur"),
    ("LeftFoot", "ltibia"),
    ("LeftToeBase", "lfoot"),
    ("LeftToeBase.end", "ltoes"),
    ("RightUpLeg", "rhipjoint"),
    ("RightLeg", "rfemur"),
    ("RightFoot", "rtibia"),
    ("RightToeBase", "rfoot"),
    ("RightToeBase.end", "rtoes"),
    ("Hips", "root"),
    ("Spine", "lowerback"),
    ("Spine1", "upperback"),
    ("Neck", "thorax"),
    ("Neck1", "lowerneck"),
    ("Head", "upperneck"),
    ("Head.end", "head"),
    ("LeftShoulder", "thorax"),
    ("LeftArm", "lclavicle"),
    ("LeftForeArm", "lhumerus"),
    ("LeftHand", "lradius"),
    ("LeftHandIndex1", "lhand"),
    ("LeftHandIndex1.end", "lfingers"),
    ("LThumb.end", "lthumb"),
    ("RightArm", "rclavicle"),
    ("RightForeArm", "rhumerus"),
    ("RightHand", "rradius"),
    ("RightHandIndex1", "rhand"),
    ("RightHandIndex1.end", "rfingers"),
    ("RThumb.end", "rthumb"),
];

/// Bones that the conversion leaves out: what hangs on them starts where they do.
const LEFT_OUT: [&str; 3] = ["thorax", "lwrist", "rwrist"];

#[test]
fn kinematics_of_asf_match_a_bvh_of_the_same_trial() {
    let Some(folder) = motion() else { return };
    let ours = load(&(folder.join("cmu/02_02.amc"), folder.join("cmu/02.asf")));
    let path = folder.join("bvh/cmu_02_02_cgspeed.bvh");
    let bytes = std::fs::read(&path).expect("a readable file");
    // It keeps the ASF file's unit of length, and a T-pose before the first frame.
    let read = bvh::parse(&bytes, "cgspeed.bvh", 2.54 / 0.45, None).expect("a BVH file");
    let Clip { skeleton, motion } = read.clip;
    assert_eq!((motion.fps, motion.frames()), (120.0, ours.motion.frames() + 1));
    let (mut amc, mut bvh) = (Kinematics::new(&ours.skeleton), Kinematics::new(&skeleton));
    let mut amc_at = vec![[0.0; 3]; amc.joints()];
    let mut bvh_at = vec![[0.0; 3]; bvh.joints()];
    let (mut worst, mut apart_from_root) = ((0.0, "", 0), 0.0);
    for (frame, pose) in ours.motion.iter().enumerate() {
        amc.positions(pose, &mut amc_at);
        bvh.positions(motion.frame(frame + 1), &mut bvh_at);
        for (theirs, bone) in CGSPEED {
            let bone = joint(&ours.skeleton, bone);
            let mut expected = bvh_at[joint(&skeleton, theirs)];
            let mut above = Some(bone);
            while let Some(index) = above {
                let parent = ours.skeleton.joints[index].parent;
                if LEFT_OUT.contains(&ours.skeleton.joints[index].name.as_str()) {
                    let start = parent.map_or([0.0; 3], |parent| amc_at[parent]);
                    expected = std::array::from_fn(|k| expected[k] + amc_at[index][k] - start[k]);
                }
                above = parent;
            }
            let root = std::array::from_fn(|k| expected[k] + amc_at[0][k] - bvh_at[0][k]);
            raise(&mut apart_from_root, distance(root, amc_at[bone]));
            let apart = distance(expected, amc_at[bone]);
            if apart > worst.0 || apart.is_nan() {
                worst = (apart, theirs, frame);
            }
        }
    }
    // The BVH file prints four decimals. In its unit of 5.6 cm that rounds the root by up to 2.8e-4 cm along
    // each axis (4.9e-4 cm in all), and angles by 5e-5 degrees, which is 9e-5 cm at a metre's distance.
    println!(
        "02_02 as AMC and as BVH: largest difference {:.2e} cm ({} in frame {}), {apart_from_root:.2e} cm \
         without the root's",
        worst.0, worst.1, worst.2
    );
    assert!(worst.0 < ALLOWED, "{worst:?}");
}

/// What a peer made of a file.
struct Peer {
    header: serde_json::Value,
    values: Vec<f64>,
}

impl Peer {
    fn run(script: &str, arguments: &[&Path], stride: usize) -> Option<Self> {
        let python = python()?;
        let output = Command::new(python)
            .arg(workspace().join("tests/peers").join(script))
            .args(arguments)
            .arg(stride.to_string())
            .output()
            .expect("Python starts");
        assert!(output.status.success(), "{script}: {}", String::from_utf8_lossy(&output.stderr));
        let line = output.stdout.iter().position(|&byte| byte == b'\n').expect("a line of JSON");
        let header = serde_json::from_slice(&output.stdout[..line]).expect("JSON");
        let doubles = output.stdout[line + 1..].chunks_exact(8);
        let values = doubles.map(|bytes| f64::from_le_bytes(bytes.try_into().expect("8 bytes"))).collect();
        Some(Self { header, values })
    }

    fn number(&self, key: &str) -> usize {
        self.header[key].as_u64().and_then(|number| usize::try_from(number).ok()).expect("a number")
    }

    fn names(&self) -> Vec<&str> {
        let names = self.header["names"].as_array().expect("names");
        names.iter().map(|name| name.as_str().expect("a name")).collect()
    }

    fn rows(&self) -> impl Iterator<Item = &[f64]> {
        let (frames, channels) = (self.number("frames"), self.number("channels"));
        self.values[..frames * channels].chunks_exact(channels)
    }

    /// Largest distance of our joints from the peer's, which are in the rows of every `stride`-th frame.
    fn largest_distance(&self, clip: &Clip, stride: usize) -> f64 {
        let joints: Vec<usize> = self.names().iter().map(|name| joint(&clip.skeleton, name)).collect();
        let positions = &self.values[self.number("frames") * self.number("channels")..];
        let mut kinematics = Kinematics::new(&clip.skeleton);
        let mut ours = vec![[0.0; 3]; kinematics.joints()];
        let mut largest = 0.0;
        let rows = positions.chunks_exact(3 * joints.len());
        assert_eq!(rows.len(), self.number("frames").div_ceil(stride));
        for (row, pose) in rows.zip(clip.motion.iter().step_by(stride)) {
            kinematics.positions(pose, &mut ours);
            for (theirs, &joint) in row.as_chunks::<3>().0.iter().zip(&joints) {
                raise(&mut largest, distance(*theirs, ours[joint]));
            }
        }
        largest
    }
}

#[test]
fn amc_matches_pyacclaim() {
    let Some(trials) = trials() else { return };
    let (mut all_values, mut all_cm): (f64, f64) = (0.0, 0.0);
    for trial in trials {
        let clip = load(&trial);
        let stride = clip.motion.frames() / 100 + 1;
        let Some(peer) = Peer::run("import_pyacclaim.py", &[&trial.1, &trial.0], stride) else { return };
        assert_eq!(peer.number("frames"), clip.motion.frames() - 1, "it leaves the last frame out");
        let lines = peer.header["lines"].as_array().expect("lines of a frame");
        let columns: Vec<usize> = (lines.iter())
            .flat_map(|line| {
                let range = clip.skeleton.joints[joint(&clip.skeleton, line[0].as_str().expect("a bone"))]
                    .channels
                    .clone();
                assert_eq!(Some(range.len() as u64), line[1].as_u64());
                range
            })
            .collect();
        let mut largest = 0.0;
        for (theirs, ours) in peer.rows().zip(clip.motion.iter()) {
            for (value, &column) in theirs.iter().zip(&columns) {
                raise(&mut largest, (value - ours[column]).abs());
            }
        }
        let cm = peer.largest_distance(&clip, stride);
        raise(&mut all_values, largest);
        raise(&mut all_cm, cm);
    }
    println!("AMC against pyacclaim: values {all_values:.2e} (degrees or cm), joints {all_cm:.2e} cm");
    assert!(all_values < ALLOWED && all_cm < ALLOWED, "{all_values} {all_cm}");
}

/// bvhio reads doubles but computes in single precision, which is where joints differ.
fn compare_with_bvhio(path: &Path) -> Option<(f64, f64)> {
    // The peer knows no unit: its lengths are the file's.
    let options = import::Options { unit: Some(import::Unit::centimetre()), ..import::Options::default() };
    let clip = import::read(path, &options).unwrap_or_else(|error| panic!("{error}")).clip;
    let peer = Peer::run("import_bvhio.py", &[path], 1)?;
    assert_eq!(peer.number("frames"), clip.motion.frames());
    let mut largest = 0.0;
    if peer.number("channels") == clip.motion.channels {
        for (theirs, ours) in peer.rows().zip(clip.motion.iter()) {
            for (a, b) in theirs.iter().zip(ours) {
                raise(&mut largest, (a - b).abs());
            }
        }
    } else {
        // Positions that stand still are bones to us. Where the joints are says that they are the right ones.
        assert!(peer.number("channels") > clip.motion.channels, "{}", path.display());
    }
    let cm = peer.largest_distance(&clip, 1);
    println!("{} against bvhio: values {largest:.2e} (degrees or cm), joints {cm:.2e} cm", path.display());
    assert!(largest < ALLOWED && cm < ALLOWED, "{}: {largest} {cm}", path.display());
    Some((largest, cm))
}

#[test]
fn bvh_matches_bvhio() {
    let Some(folder) = motion() else { return };
    let entries = std::fs::read_dir(folder.join("bvh")).expect("a folder of BVH files");
    for entry in entries {
        if compare_with_bvhio(&entry.expect("a readable folder").path()).is_none() {
            return;
        }
    }
}

#[test]
fn unusual_bvh_matches_bvhio() {
    let text = "HIERARCHY\r\nROOT a:b\r\n{\r\n  OFFSET 1 94 -2\r\n  CHANNELS 6 Yrotation Zposition Xrotation \
        Xposition Zrotation Yposition\n\tJOINT left arm\n\t{\n\t\tOFFSET 0.5 -3e1 7\n\t\tCHANNELS 6 Xposition \
        Yposition Zposition Xrotation Zrotation Yrotation\n\t\tJOINT c\n{\nOFFSET 1 2 3\nCHANNELS 2 Yrotation \
        Xrotation\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\n}\n\tJOINT d\n{\nOFFSET -4 5 6\nCHANNELS 3 Zrotation \
        Xrotation Yrotation\nEnd Site\n{\nOFFSET 1 0 0\n}\n}\n}\nMOTION\nFrames:\t2\nFrame Time: .04\n\
        10 1 20 2 30 3  4 5 6 40 50 60  70 80  15 25 35\n\
        -100.5 1e1 2e-1 .5 170 -3 9 8 7 -6 5 -4 33 22 -11 179 -179\n";
    // bvhio takes the first word of a name only.
    let text = text.replace("left arm", "left_arm");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("unusual.bvh");
    std::fs::write(&path, text).expect("a writable folder");
    compare_with_bvhio(&path);
}

#[test]
fn our_bvh_of_an_asf_skeleton_is_what_bvhio_reads() {
    let clip = sample::clip();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("puppet.bvh");
    let mut file = Vec::new();
    export::bvh::write(&mut file, &clip.skeleton, &clip.motion).expect("a Vec takes it");
    std::fs::write(&path, file).expect("a writable folder");
    if compare_with_bvhio(&path).is_none() {
        return;
    }
    let again = import::load(&path, None, None).expect("our own BVH file");
    let (mut asf, mut bvh) = (Kinematics::new(&clip.skeleton), Kinematics::new(&again.skeleton));
    let asf_at = asf.all_positions(&clip.motion);
    let bvh_at = bvh.all_positions(&again.motion);
    let mut largest = 0.0;
    for (index, bone) in clip.skeleton.joints.iter().enumerate() {
        // A bone ends where its child, or its End Site, starts.
        let child = again.skeleton.joints.iter().position(|other| {
            other.parent.is_some_and(|parent| again.skeleton.joints[parent].name == bone.name)
        });
        let child = if bone.parent.is_none() { Some(0) } else { child };
        let child = child.expect("every bone has something at its end");
        for frame in 0..clip.motion.frames() {
            let at = asf_at[frame * asf.joints() + index];
            raise(&mut largest, distance(at, bvh_at[frame * bvh.joints() + child]));
        }
    }
    println!("the puppet as ASF/AMC and as BVH: largest difference {largest:.2e} cm");
    assert!(largest < 1e-4, "{largest}");
}
