//! The short form of fuzzing: every target with its seeds, and with as many changed ones as a minute takes in all.
//! `BUNRAKU_FUZZ=10 cargo test -p bunraku-fuzz` takes ten times as many.

use bunraku_fuzz::mutate::mutate;
use bunraku_fuzz::{Random, TARGETS};

fn fuzz(name: &str, inputs: usize) {
    let target = TARGETS.into_iter().find(|target| target.name == name).expect("a target of that name");
    let times =
        std::env::var("BUNRAKU_FUZZ").map_or(1, |times| times.parse().expect("BUNRAKU_FUZZ: a number"));
    let inputs = inputs * times;
    let seeds = (target.seeds)();
    for (number, seed) in seeds.iter().enumerate() {
        assert!((target.check)(seed), "seed {number} of {name} is refused");
    }
    let mut random = Random::new(1);
    let mut accepted = 0;
    for _ in 0..inputs {
        let mut bytes = seeds[random.below(seeds.len())].clone();
        mutate(&mut bytes, &seeds[random.below(seeds.len())], &mut random);
        accepted += usize::from((target.check)(&bytes));
    }
    println!("{name}: {inputs} inputs changed from {} seeds, {accepted} accepted", seeds.len());
    // Else nothing behind the first check was seen, or nothing was checked.
    assert!((inputs / 100..inputs - inputs / 100).contains(&accepted), "{accepted} of {inputs} accepted");
}

#[test]
fn qmd() {
    fuzz("qmd", 500_000);
}

#[test]
fn mclip() {
    fuzz("mclip", 150_000);
}

#[test]
fn asf() {
    fuzz("asf", 500_000);
}

#[test]
fn amc() {
    fuzz("amc", 300_000);
}

#[test]
fn bvh() {
    fuzz("bvh", 200_000);
}

#[test]
fn dynamixel() {
    fuzz("dynamixel", 4_000_000);
}

#[test]
fn link() {
    fuzz("link", 20_000);
}
