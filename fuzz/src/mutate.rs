//! Changes inputs at random, as fuzzers do that know nothing of them.

use crate::Random;

/// Numbers at which code changes its mind.
const EDGES: [u8; 9] = [0, 1, 15, 16, 127, 128, 129, 254, 255];

/// Changes `bytes` in 1 to 4 places. `other` is an input of which parts may be taken.
pub fn mutate(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    for _ in 0..=random.below(4) {
        edit(bytes, other, random);
    }
}

fn edit(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    if bytes.is_empty() {
        bytes.push(random.below(256) as u8);
    }
    let at = random.below(bytes.len());
    let end = (at + 1 + random.below(32)).min(bytes.len());
    match random.below(10) {
        0 => bytes[at] = random.below(256) as u8,
        1 => bytes[at] ^= 1 << random.below(8),
        2 => bytes[at] = EDGES[random.below(EDGES.len())],
        3 => bytes[at] = bytes[at].wrapping_add(1),
        4 => bytes[at] = bytes[at].wrapping_sub(1),
        5 => bytes.insert(at, random.below(256) as u8),
        6 => drop(bytes.drain(at..end)),
        7 => bytes.truncate(at),
        8 => {
            let part = bytes[at..end].to_vec();
            let to = random.below(bytes.len());
            drop(bytes.splice(to..to, part));
        }
        _ => {
            let from = random.below(other.len());
            let part = &other[from..(from + end - at).min(other.len())];
            drop(bytes.splice(at..(at + part.len()).min(bytes.len()), part.iter().copied()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_become_longer_shorter_and_other_and_the_same_on_every_run() {
        let run = || {
            let mut random = Random::new(1);
            let changed = (0..1000).map(|_| {
                let mut bytes = b"one input".to_vec();
                mutate(&mut bytes, b"ANOTHER", &mut random);
                bytes
            });
            changed.collect::<Vec<_>>()
        };
        let all = run();
        assert_eq!(all, run());
        let count = |what: fn(&Vec<u8>) -> bool| all.iter().filter(|bytes| what(bytes)).count();
        assert!(count(|bytes| bytes.len() > 9) > 100);
        assert!(count(|bytes| bytes.len() < 9) > 100);
        assert!(count(|bytes| bytes.as_slice() == b"one input") < 100);
        assert!(count(|bytes| bytes.iter().any(u8::is_ascii_uppercase)) > 100);
    }

    #[test]
    fn nothing_can_be_changed_too() {
        let mut random = Random::new(2);
        for _ in 0..1000 {
            let mut bytes = Vec::new();
            mutate(&mut bytes, &[], &mut random);
        }
    }
}
