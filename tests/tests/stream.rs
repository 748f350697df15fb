//! Recorded clips streamed over a link that loses, delays, doubles and damages packets.
#![allow(clippy::unwrap_used)]

use bunraku_tests::live::{Clip, clips, with_clips};
use decoder_core::I16F16;
use decoder_core::mclip::BlockHeader;
use firmware::clips::LIVE;
use firmware::frames::Frames;
use firmware::library::Library;
use firmware::play_error::PlayError;
use firmware::stream::{Counters, StreamError};
use mocap::kinematics::Kinematics;

/// Numbers without a pattern (splitmix64): the ones that the table in docs/STORE.md was measured with.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ (mixed >> 31)) % end
    }

    fn percent(&mut self, percent: u64) -> bool {
        self.below(100_000) < percent * 1000
    }
}

/// What a link does to packets.
#[derive(Clone, Copy, Debug, Default)]
struct Link {
    /// Percent of packets that are lost, in bursts of three on average.
    loss: u64,
    /// Percent that come up to 250 ms late, and overtake each other so.
    reorder: u64,
    /// Percent that come twice.
    twice: u64,
    /// Percent that have a bit flipped.
    flip: u64,
}

/// What was shown.
#[derive(Clone, Copy, Debug, Default)]
struct Shown {
    counters: Counters,
    frames: u32,
    /// Distance in cm, averaged over joints and concealed frames: as shown, and if the last right frame were held.
    concealed_cm: f64,
    held_cm: f64,
    /// The same over frames on the way back.
    eased_cm: f64,
    /// The largest step of a joint in a frame, in the largest of the clip itself; and if frames were held, and jumped back to.
    step: f64,
    held_step: f64,
}

/// Joints, the root being where it should.
struct Body(Kinematics);

impl Body {
    fn places(&mut self, pose: &[I16F16], root: &[I16F16]) -> Vec<[f64; 3]> {
        let values: Vec<f64> = root[..6].iter().chain(&pose[6..]).map(|value| value.to_num()).collect();
        let mut places = vec![[0.0; 3]; self.0.joints()];
        self.0.positions(&values, &mut places);
        places
    }

    fn distances(&mut self, one: &[I16F16], other: &[I16F16], root: &[I16F16]) -> (f64, f64) {
        let (one, other) = (self.places(one, root), self.places(other, root));
        let cm = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
        let all = one.iter().zip(&other).map(cm);
        let (most, sum) = all.fold((0f64, 0.0), |(most, sum), cm| (most.max(cm), sum + cm));
        (most, sum / one.len() as f64)
    }
}

/// Plays a clip, whose largest step of a joint is `own` cm, over a link; sent ahead as far as the buffer takes it.
fn stream(clip: &Clip, own: f64, link: Link, seed: u64) -> Shown {
    with_clips(6000, &[], None, |mut clips, live| {
        let mut random = Random(seed);
        live.begin(clip.header.len() as u32).unwrap();
        for (index, part) in clip.header.chunks(100).enumerate() {
            let whole = live.header(index as u32 * 100, part).unwrap();
            assert_eq!(whole, (index + 1) * 100 >= clip.header.len());
        }
        let mut frames = clips.open(LIVE).map_err(|error| error.to_string()).unwrap();
        assert_eq!(clips.open(LIVE).err(), Some(PlayError::NoDecoder), "only one plays");
        assert_eq!(live.begin(1), Err(StreamError::Playing));
        let mut body = Body(Kinematics::new(&clip.skeleton));
        let mut way: Vec<(u64, Vec<u8>)> = vec![];
        let (mut sent, mut burst, mut shown) = (0, false, Shown::default());
        let mut last: Option<Vec<I16F16>> = None;
        let (mut right, mut held) = (clip.frames[0].clone(), clip.frames[0].clone());
        let mut last_right = true;
        let millis_of_frame = 100_000 / u64::from(clip.rate_centihertz);
        for now in 0.. {
            let progress = live.progress();
            // What it cannot begin without is sent again.
            if shown.frames == 0 && way.is_empty() {
                let missing = |&block: &usize| clip.frames_of(block).0 as u32 == progress.received;
                sent = (0..sent).find(missing).unwrap_or(sent);
            }
            while sent < clip.blocks.len()
                && clip.frames_of(sent).0 as u32 <= progress.position + 48
                && way.len() < usize::from(progress.free_blocks)
            {
                let block = clip.blocks[sent].clone();
                sent += 1;
                // A burst goes on with 2 in 3, and begins so often that the share of lost packets is right.
                burst = if burst {
                    random.below(3) > 0
                } else {
                    random.below(300 * (100 - link.loss)) < 100 * link.loss
                };
                if burst {
                    continue;
                }
                for _ in 0..1 + u64::from(random.percent(link.twice)) {
                    let most = 250 / millis_of_frame;
                    let delay = if random.percent(link.reorder) { random.below(most) } else { 0 };
                    let mut block = block.clone();
                    if random.percent(link.flip) {
                        let bit = random.below(block.len() as u64 * 8);
                        block[bit as usize / 8] ^= 1 << (bit % 8);
                    }
                    way.push((now + delay, block));
                }
            }
            let mut damaged = live.counters().damaged;
            way.retain(|(due, block)| {
                let comes = *due <= now;
                if comes && live.receive(block).is_err() {
                    damaged += 1;
                }
                !comes
            });
            assert_eq!(live.counters().damaged, damaged);
            let before = live.counters();
            let position = frames.position() as usize;
            let Some(frame) = frames.next_frame().unwrap() else {
                if position == clip.frames.len() {
                    break;
                }
                assert_eq!(shown.frames, 0, "it waits only before the first frame");
                assert!(now < 1000);
                continue;
            };
            let frame = frame.to_vec();
            shown.frames += 1;
            let after = live.counters();
            // The first frame is that of an entry point, and all of them have their numbers.
            let position = if shown.frames == 1 { frames.position() as usize - 1 } else { position };
            let truth = &clip.frames[position];
            assert_eq!(frames.position() as usize, position + 1);
            let is_right = after.played > before.played;
            if is_right {
                assert_eq!(&frame, truth, "frame {position}");
                right.clone_from(truth);
            }
            let concealed = after.concealed > before.concealed;
            if concealed {
                shown.concealed_cm += body.distances(&frame, truth, truth).1;
                shown.held_cm += body.distances(&right, truth, truth).1;
            } else if !is_right {
                shown.eased_cm += body.distances(&frame, truth, truth).1;
            }
            // One who holds would be right wherever this is not concealed.
            let holds = if concealed { right.clone() } else { truth.clone() };
            if let (Some(last), false) = (&last, is_right && last_right) {
                shown.step = shown.step.max(body.distances(&frame, last, truth).0 / own);
                shown.held_step = shown.held_step.max(body.distances(&holds, &held, truth).0 / own);
            }
            if !concealed {
                right.clone_from(truth);
            }
            held = holds;
            last_right = is_right;
            last = Some(frame);
        }
        shown.counters = live.counters();
        assert!(last_right || link.loss + link.reorder + link.flip > 0);
        let Counters { played, concealed, eased, .. } = shown.counters;
        assert_eq!(played + concealed + eased, shown.frames);
        shown.concealed_cm /= f64::from(concealed.max(1));
        shown.held_cm /= f64::from(concealed.max(1));
        shown.eased_cm /= f64::from(eased.max(1));
        clips.close(frames);
        live.begin(1).unwrap();
        shown
    })
}

/// Nothing is lost: every frame is the clip's.
fn over_a_sound_link(clip: &Clip) {
    for link in [Link::default(), Link { twice: 100, ..Link::default() }] {
        let shown = stream(clip, 1.0, link, 1);
        assert_eq!(shown.frames as usize, clip.frames.len());
        let Counters { played, duplicates, .. } = shown.counters;
        assert_eq!((played, duplicates > 0), (shown.frames, link.twice > 0));
        assert_eq!(shown.counters, Counters { played, duplicates, ..Counters::default() });
    }
}

/// The largest step of a joint in a frame of a clip, in cm.
fn own(clip: &Clip) -> f64 {
    let mut body = Body(Kinematics::new(&clip.skeleton));
    let steps = clip.frames.windows(2).map(|pair| body.distances(&pair[0], &pair[1], &pair[0]).0);
    steps.fold(0.0, f64::max)
}

fn add(sum: &mut Counters, counters: Counters) {
    let Counters { played, concealed, eased, lost, late, duplicates, damaged, overflowed } = counters;
    for (sum, count) in [
        (&mut sum.played, played),
        (&mut sum.concealed, concealed),
        (&mut sum.eased, eased),
        (&mut sum.lost, lost),
        (&mut sum.late, late),
        (&mut sum.duplicates, duplicates),
        (&mut sum.damaged, damaged),
        (&mut sum.overflowed, overflowed),
    ] {
        *sum += count;
    }
}

#[test]
fn recorded_clips_come_through_and_losses_are_bridged_without_a_step() {
    for entries in [2.0, 10.0] {
        let Some(clips) = clips(usize::MAX, entries) else { return };
        clips.iter().for_each(over_a_sound_link);
        let own: Vec<f64> = clips.iter().map(own).collect();
        let bytes: usize = clips.iter().flat_map(|clip| &clip.blocks).map(Vec::len).sum();
        for loss in [1, 5, 20] {
            let link = Link { loss, reorder: 10, twice: 5, flip: 1 };
            let mut all = Shown::default();
            for (seed, (clip, &own)) in clips.iter().zip(&own).enumerate() {
                let shown = stream(clip, own, link, seed as u64 + 10 * loss);
                add(&mut all.counters, shown.counters);
                all.frames += shown.frames;
                all.concealed_cm += shown.concealed_cm * f64::from(shown.counters.concealed);
                all.held_cm += shown.held_cm * f64::from(shown.counters.concealed);
                all.eased_cm += shown.eased_cm * f64::from(shown.counters.eased);
                all.step = all.step.max(shown.step);
                all.held_step = all.held_step.max(shown.held_step);
            }
            let Counters { concealed, eased, .. } = all.counters;
            all.concealed_cm /= f64::from(concealed);
            all.held_cm /= f64::from(concealed);
            all.eased_cm /= f64::from(eased);
            println!("{loss} % lost, {entries} entry points a second, {bytes} bytes: {all:.2?}");
            // Holding is as good where a loss lasts for a second: half a second to the next entry point, and lost again.
            // With two entry points a second half a second is made up after each loss: too long for either.
            let worse = if entries < 10.0 { 1.15 } else { 1.0 };
            assert!(all.concealed_cm < worse * all.held_cm);
            assert!(all.step < 3.0 && all.step < all.held_step / 4.0);
        }
    }
}

/// Packets of no sense, and blocks whose checksums are right and whose codes are not: the first are refused, the second
/// are bridged like a loss.
#[test]
fn garbage_does_no_harm() {
    let Some(clips) = clips(1, 10.0) else { return };
    let clip = &clips[0];
    with_clips(6000, &[], None, |mut library, live| {
        let mut random = Random(7);
        let mut bytes = |most: u64| -> Vec<u8> {
            let length = random.below(most);
            (0..length).map(|_| random.below(256) as u8).collect()
        };
        assert_eq!(live.receive(&clip.blocks[0]), Err(StreamError::NoHeader));
        assert_eq!(live.begin(7000), Err(StreamError::TooLarge { needed: 7000, room: 6000 }));
        for _ in 0..10_000 {
            let garbage = bytes(600);
            live.begin(garbage.len() as u32).unwrap();
            let taken = live.header(0, &garbage);
            assert!(taken.is_err(), "{taken:?}");
            assert!(live.receive(&garbage).is_err());
        }
        let length = clip.header.len() as u32;
        live.begin(length).unwrap();
        assert_eq!(live.header(1, &clip.header), Err(StreamError::Gap { expected: 0, found: 1 }));
        let long = [&clip.header[..], &[0]].concat();
        assert_eq!(live.header(0, &long), Err(StreamError::TooLarge { needed: length + 1, room: length }));
        assert_eq!(live.header(0, &clip.header[..50]), Ok(false));
        assert_eq!(live.header(0, &clip.header[..30]), Ok(false));
        assert_eq!(live.header(20, &clip.header[20..]), Ok(true));
        let mut frames = library.open(LIVE).map_err(|error| error.to_string()).unwrap();
        let (mut refused, mut forged, mut block) = (0, 0, 0);
        while (frames.position() as usize) < clip.frames.len() {
            while block < clip.blocks.len() && live.progress().free_blocks > 0 {
                let (first, end) = clip.frames_of(block);
                if first as u32 > frames.position() + 48 {
                    break;
                }
                if block % 7 == 3 {
                    let entry = clip.blocks[block][7] >> 7 == 1;
                    let codes = bytes(300);
                    let header = BlockHeader::of(&codes, (end - first) as u16, first as u32, entry).unwrap();
                    live.receive(&[&header.emit()[..], &codes].concat()).unwrap();
                    forged += 1;
                } else {
                    live.receive(&clip.blocks[block]).unwrap();
                }
                block += 1;
            }
            for _ in 0..10 {
                let garbage = bytes(100);
                refused += u32::from(!garbage.is_empty() && live.receive(&garbage).is_err());
                let cut = &clip.blocks[block - 1][..20];
                assert!(live.receive(cut).is_err());
            }
            frames.next_frame().unwrap();
        }
        let Counters { played, concealed, damaged, .. } = live.counters();
        println!("{forged} forged blocks, {damaged} damaged: {:?}", live.counters());
        assert!(refused > 10_000 && damaged > refused && forged > 10);
        assert!(played > 500 && concealed > 100);
        library.close(frames);
    });
}
