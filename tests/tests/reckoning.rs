//! Dead reckoning on recorded motion.
#![allow(clippy::unwrap_used)]

use bunraku_tests::motion;
use decoder_core::I16F16;
use decoder_core::mclip::CodecId;
use encoder::kinematics::Kinematics;
use encoder::mclip::{Encoder, Quality, Settings, decode};
use firmware::stream::{Reckoner, Reckoning};

#[test]
fn study() {
    let Some(folder) = motion() else { return };
    let mut names: Vec<_> = std::fs::read_dir(folder.join("cmu"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "amc"))
        .collect();
    names.sort();
    let gaps = [4usize, 12, 24, 60];
    let clips: Vec<_> = names
        .iter()
        .map(|path| {
            let subject = path.file_stem().unwrap().to_str().unwrap().split('_').next().unwrap().to_owned();
            let clip =
                encoder::import::load(path, Some(&path.with_file_name(format!("{subject}.asf"))), None)
                    .unwrap();
            let bytes = Encoder::new(&clip.skeleton, &clip.motion)
                .unwrap()
                .encode(&Settings::new(CodecId::Dpcm), Quality::Step(0.25));
            let motion = decode(&bytes).unwrap();
            (clip.skeleton, motion)
        })
        .collect();
    let run = |label: &str, reckoning: &dyn Fn(u16) -> Option<Reckoning>| {
        let mut sums = [[0.0f64; 4]; 2];
        let mut n = [0usize; 4];
        for (skeleton, motion) in &clips {
            let mut kin = Kinematics::new(skeleton);
            let j = kin.joints();
            let (mut a, mut b) = (vec![[0.0; 3]; j], vec![[0.0; 3]; j]);
            let rate = (motion.fps * 100.0).round() as u16;
            let fixed: Vec<Vec<I16F16>> =
                motion.iter().map(|f| f.iter().map(|&v| I16F16::from_num(v)).collect()).collect();
            let m = fixed[0].len();
            for start in (20..fixed.len().saturating_sub(61)).step_by(97) {
                let mut mem = vec![I16F16::ZERO; 4 * m];
                let mut parts = mem.chunks_mut(m);
                let poses = std::array::from_fn(|_| parts.next().unwrap());
                let r = reckoning(rate);
                let mut reck = Reckoner::new(poses, r.unwrap_or(Reckoning::new(rate, 50, 0, 100)));
                for f in &fixed[start - 20..start] {
                    reck.right(f);
                }
                let mut err = [0.0; 2];
                for k in 0..60 {
                    if r.is_some() {
                        reck.missing();
                    }
                    let truth: Vec<f64> = motion.frame(start + k).to_vec();
                    let mut pose: Vec<f64> = reck.shown().iter().map(|v| v.to_num()).collect();
                    for which in 0..2 {
                        if which == 1 {
                            pose[..6].copy_from_slice(&truth[..6]);
                        }
                        kin.positions(&pose, &mut a);
                        kin.positions(&truth, &mut b);
                        err[which] += a
                            .iter()
                            .zip(&b)
                            .map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt())
                            .sum::<f64>()
                            / j as f64;
                    }
                    if let Some(g) = gaps.iter().position(|&g| g == k + 1) {
                        for w in 0..2 {
                            sums[w][g] += err[w] / (k + 1) as f64;
                        }
                        n[g] += 1;
                    }
                }
            }
        }
        let means: Vec<Vec<f64>> =
            sums.iter().map(|sums| sums.iter().zip(n).map(|(s, n)| s / n as f64).collect()).collect();
        println!("{label}: {means:.3?} n={n:?}");
    };
    run("hold", &|_| None);
    for decay in [25, 50, 75, 100, 150, 200, 300, 1000] {
        for average in [0, 8, 17, 33] {
            run(&format!("decay {decay} average {average}"), &|rate| {
                Some(Reckoning::new(rate, decay, average, 100))
            });
        }
    }
}
