//! Clips in flash whose power is cut in every operation, and again in the recovery from that.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{mclip, vectors};
use decoder_core::mclip::{Clip, Needs, checksum};
use decoder_core::{Error, Field, Limits};
use firmware::store::{Entry, Layout, MappedFlash, Status, Store, StoreError};
use host_sim::flash::{Flash, Tear};
use std::collections::BTreeMap;

const SECTOR: usize = 1024;
type Small = Flash<SECTOR>;

/// What decoders of all golden vectors need.
const CAPACITY: Needs = Needs { channels: 512, words: 2048, halves: 16384 };

/// Two sectors of directory, apart from each other, and twenty-four of clips.
fn layout() -> Layout {
    Layout { directory: [0, 25 * 1024], clips: 1024..25 * 1024 }
}

const SECTORS: usize = 26;

fn mount(flash: &mut Small) -> Store<&mut Small> {
    Store::mount(flash, layout(), CAPACITY).unwrap()
}

fn vector(name: &str) -> Vec<u8> {
    let all = mclip::all().into_iter().chain(vectors::all());
    all.into_iter().find(|vector| vector.name == name).unwrap().bytes
}

/// What is done to a store.
#[derive(Clone, Debug)]
enum Deed {
    Upload(u16, Vec<u8>),
    Remove(u16),
}

/// Steps until the store has nothing to do, or waits for bytes.
fn finish<F: MappedFlash>(store: &mut Store<F>) -> Result<Status, StoreError> {
    for _ in 0..1000 {
        let status = store.step()?;
        if let Status::Idle | Status::Receiving { .. } = status {
            return Ok(status);
        }
    }
    panic!("{:?} does not end", store.status());
}

/// An upload as a link makes it, in messages of odd lengths.
fn upload<F: MappedFlash>(store: &mut Store<F>, clip: u16, bytes: &[u8]) -> Result<(), StoreError> {
    store.begin(clip, &format!("clip {clip}"), bytes.len() as u32, checksum(bytes, &[]))?;
    assert_eq!(finish(store)?, Status::Receiving { received: 0 });
    for (index, chunk) in bytes.chunks(201).enumerate() {
        store.write(index as u32 * 201, chunk)?;
    }
    store.commit()?;
    finish(store).map(|status| assert_eq!(status, Status::Idle))
}

fn perform(flash: &mut Small, deed: &Deed) -> Result<(), StoreError> {
    let mut store = mount(flash);
    match deed {
        Deed::Upload(clip, bytes) => upload(&mut store, *clip, bytes),
        Deed::Remove(clip) => {
            store.remove(*clip)?;
            finish(&mut store).map(|status| assert_eq!(status, Status::Idle))
        }
    }
}

type Contents = BTreeMap<u16, Vec<u8>>;

/// All clips, each of which can be played to its end.
fn contents(flash: &mut Small) -> Contents {
    let before = flash.operations();
    let store = mount(flash);
    let clips = store.list().map(|Entry { clip, name, bytes, crc, frames, .. }| {
        let found = store.get(clip).unwrap().to_vec();
        assert_eq!((found.len(), checksum(&found, &[])), (bytes as usize, crc));
        assert_eq!(name.as_str(), format!("clip {clip}"));
        if found.starts_with(b"MCLP") {
            let parsed = Clip::parse(&found, Limits::MAX).and_then(Clip::verify).unwrap();
            assert_eq!(parsed.frames(), frames);
        }
        (clip, found)
    });
    let clips: Contents = clips.collect();
    drop(store);
    assert_eq!(flash.operations(), before, "finding the clips writes nothing");
    clips
}

fn after(mut before: Contents, deed: &Deed) -> Contents {
    match deed {
        Deed::Upload(clip, bytes) => before.insert(*clip, bytes.clone()),
        Deed::Remove(clip) => before.remove(clip),
    };
    before
}

/// Two clips, with a hole between them, and a generation that is not the first.
fn started() -> Small {
    let mut flash = Small::new(SECTORS);
    for deed in [
        Deed::Upload(3, vector("mulaw.mclip")),
        Deed::Upload(1, vector("adpcm-sliding-edges.mclip")),
        Deed::Upload(9, vector("pcm.mclip")),
        Deed::Remove(3),
    ] {
        perform(&mut flash, &deed).unwrap();
    }
    flash
}

fn deeds() -> Vec<Deed> {
    vec![
        // The clip is there already, and stays until the new one is; another one; the last of a kind; and one less.
        Deed::Upload(1, vector("dpcm-octets.mclip")),
        Deed::Upload(4, vector("adpcm-step.mclip")),
        Deed::Upload(0, vector("qmd-segments.qmd")),
        Deed::Remove(9),
    ]
}

/// A deed, begun and cut in its operation number `cut`; false where there is no such operation.
fn cut(flash: &mut Small, deed: &Deed, cut: u64, tear: Tear) -> bool {
    flash.cut_after(cut, tear);
    let done = perform(flash, deed);
    let is_cut = flash.is_dead();
    flash.power_on();
    assert!(done.is_err() || !is_cut, "an operation that failed went unnoticed");
    is_cut
}

#[test]
fn a_cut_and_another_one_in_the_recovery_leave_the_old_clips_or_the_new_ones() {
    let first = || Deed::Upload(2, vector("mulaw.mclip"));
    // Flash that held anything before.
    let anything = (0..SECTORS * SECTOR).map(|at| (at * at / 7) as u8).collect();
    let used = deeds().into_iter().map(|deed| (started(), deed));
    let cases_of = used.chain([(Small::new(SECTORS), first()), (Small::from_image(anything), first())]);
    let mut cases = 0;
    for (base, deed) in cases_of {
        let old = contents(&mut base.clone());
        let new = after(old.clone(), &deed);
        let check = |flash: &mut Small| {
            let found = contents(flash);
            assert!(found == old || found == new, "{deed:?}: clips {:?}", found.keys());
            found == new
        };
        for first in 0.. {
            let mut was_cut = false;
            for tear in Tear::ALL {
                let mut flash = base.clone();
                was_cut = cut(&mut flash, &deed, first, tear);
                if !was_cut {
                    break;
                }
                cases += 1;
                if check(&mut flash) && matches!(deed, Deed::Remove(_)) {
                    continue;
                }
                for second in 0.. {
                    let mut was_cut = false;
                    for tear in Tear::ALL {
                        let mut flash = flash.clone();
                        was_cut = cut(&mut flash, &deed, second, tear);
                        if !was_cut {
                            break;
                        }
                        cases += 1;
                        if !check(&mut flash) || !matches!(deed, Deed::Remove(_)) {
                            perform(&mut flash, &deed).unwrap();
                        }
                        assert_eq!(contents(&mut flash), new);
                    }
                    if !was_cut {
                        break;
                    }
                }
            }
            if !was_cut {
                break;
            }
        }
    }
    println!("{cases} cuts, one or two in a row");
    assert!(cases > 10_000, "{cases}");
}

/// The directory as docs/STORE.md has it, read by other code than the store's.
fn documented(image: &[u8]) -> Contents {
    let u16_at = |at: usize| usize::from(u16::from_le_bytes(image[at..at + 2].try_into().unwrap()));
    let u32_at = |at: usize| u32::from_le_bytes(image[at..at + 4].try_into().unwrap());
    let directory = [0, 25 * 1024].into_iter().filter(|&at| {
        let records = at + 64..at + 64 + 64 * u16_at(at + 6);
        image[at..at + 6] == *b"BNKD\x01\0"
            && records.end <= at + SECTOR
            && checksum(&image[at..at + 12], &image[records]) == u32_at(at + 12)
    });
    let Some(at) = directory.max_by_key(|&at| u32_at(at + 8)) else { return Contents::new() };
    let records = (0..u16_at(at + 6)).map(|index| at + 64 * (index + 1));
    let clip = |record: usize| {
        let from = u32_at(record + 4) as usize;
        (u16_at(record) as u16, image[from..from + u32_at(record + 8) as usize].to_vec())
    };
    records.map(clip).collect()
}

#[test]
fn the_bytes_on_flash_are_those_of_the_document() {
    let mut flash = started();
    assert_eq!(documented(flash.image()), contents(&mut flash));
    for deed in deeds() {
        perform(&mut flash, &deed).unwrap();
        assert_eq!(documented(flash.image()), contents(&mut flash));
    }
}

/// Bits that fall over by themselves, one at a time, in both directories.
#[test]
fn a_flipped_bit_in_the_directory_leaves_the_one_before() {
    let base = started();
    let new = contents(&mut base.clone());
    let mut fallen = 0;
    for sector in [0, 25 * 1024] {
        for bit in 0..8 * (64 * 4) {
            let mut flash = base.clone();
            flash.image_mut()[sector + bit / 8] ^= 1 << (bit % 8);
            let store = mount(&mut flash);
            let found: Vec<_> = store.list().map(|entry| entry.clip).collect();
            // The directory before still has clip 3.
            fallen += usize::from(found == [1, 3, 9]);
            assert!(found == [1, 9] || found == [1, 3, 9], "{found:?}");
        }
    }
    assert_eq!(new.len(), 2);
    // Magic, version, count, generation, checksum and two records.
    assert_eq!(fallen, 8 * (16 + 2 * 64));
}

#[test]
fn what_is_wrong_with_an_upload_is_said_and_changes_nothing() {
    let mut flash = started();
    let old = contents(&mut flash);
    let sound = vector("adpcm-sliding-edges.mclip");
    let crc = checksum(&sound, &[]);
    let length = sound.len() as u32;
    let mut store = mount(&mut flash);
    assert_eq!(store.write(0, &[1]), Err(StoreError::NoUpload));
    assert_eq!(store.commit(), Err(StoreError::NoUpload));
    assert_eq!(store.begin(1, "", 0, 0), Err(StoreError::Empty));
    assert_eq!(store.begin(1, &"n".repeat(33), 1, 0), Err(StoreError::Name { found: 33 }));
    assert_eq!(store.remove(7), Err(StoreError::NoClip { clip: 7 }));
    let room = store.room();
    assert_eq!(store.begin(1, "", room + 1, 0), Err(StoreError::Full { needed: room + 1, room }));
    assert_eq!(store.begin(1, "", u32::MAX, 0), Err(StoreError::Full { needed: u32::MAX, room }));
    store.begin(1, "clip 1", length, crc).unwrap();
    assert_eq!(store.write(0, &sound), Err(StoreError::Busy), "not erased yet");
    finish(&mut store).unwrap();
    assert_eq!(store.write(1, &sound), Err(StoreError::Gap { expected: 0, found: 1 }));
    assert_eq!(store.write(0, &[&sound[..], &[0]].concat()), Err(StoreError::TooLong { bytes: length }));
    assert_eq!(store.write(0, &sound[..300]), Ok(300));
    assert_eq!(store.write(0, &sound[..100]), Ok(300), "known already");
    assert_eq!(store.write(u32::MAX, &[1]), Err(StoreError::Gap { expected: 300, found: u32::MAX }));
    assert_eq!(store.commit(), Err(StoreError::Incomplete { received: 300, bytes: length }));
    assert_eq!(store.write(200, &sound[200..]), Ok(length));
    store.commit().unwrap();
    assert_eq!(finish(&mut store), Ok(Status::Idle));
    // The same bytes, but not those that were announced; and sound bytes that are no clip, or too large a one.
    for (bytes, crc, expected) in [
        (sound.clone(), crc ^ 1, StoreError::Checksum { found: crc, expected: crc ^ 1 }),
        (
            sound[..sound.len() - 1].to_vec(),
            checksum(&sound[..sound.len() - 1], &[]),
            StoreError::Clip(Clip::parse(&sound[..sound.len() - 1], Limits::MAX).unwrap_err()),
        ),
    ] {
        store.begin(1, "clip 1", bytes.len() as u32, crc).unwrap();
        finish(&mut store).unwrap();
        store.write(0, &bytes).unwrap();
        store.commit().unwrap();
        assert_eq!(finish(&mut store), Err(expected));
        assert_eq!(store.status(), Status::Idle);
    }
    drop(store);
    assert_eq!(contents(&mut flash), old);
    let needs = Clip::parse(&sound, Limits::MAX).unwrap().header().needs();
    let small = Needs { halves: needs.halves - 1, ..needs };
    let mut store = Store::mount(&mut flash, layout(), small).unwrap();
    let error = Error::OutputTooSmall { field: Field::Halves, needed: needs.halves, lent: small.halves };
    assert_eq!(upload(&mut store, 5, &sound), Err(StoreError::Clip(error)));
}

/// Every bit of a small clip, flipped on the way or by the flash: it never gets a record.
#[test]
fn no_damaged_clip_is_recorded() {
    let sound = vector("dpcm-one-channel.mclip");
    let (mut refused, mut flash) = (0, started());
    let old = contents(&mut flash);
    let mut store = mount(&mut flash);
    for bit in 0..sound.len() * 8 {
        let mut damaged = sound.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        // Announced with the damage, as by a host whose file is damaged: only the clip's own checksums find it.
        refused += usize::from(matches!(upload(&mut store, 5, &damaged), Err(StoreError::Clip(_))));
    }
    assert_eq!(refused, sound.len() * 8);
    drop(store);
    assert_eq!(contents(&mut flash), old);
}

/// Uploads of all kinds, again and again, until nothing fits: sectors that a clip or a decoder has stay as they are.
#[test]
fn what_is_played_is_not_written_over() {
    let mut flash = Small::new(SECTORS);
    let mut store = mount(&mut flash);
    let (old, new) = (vector("dpcm-first.mclip"), vector("dpcm-second.mclip"));
    upload(&mut store, 1, &old).unwrap();
    let at = store.entry(1).unwrap().at;
    let lease = store.lease(1).unwrap();
    assert_eq!(lease.bytes(), old);
    let room = store.room();
    // The record goes, the bytes stay as long as they are lent.
    for _ in 0..20 {
        upload(&mut store, 1, &new).unwrap();
        assert_ne!(store.entry(1).unwrap().at, at);
        assert_eq!(lease.bytes(), old);
    }
    store.remove(1).unwrap();
    finish(&mut store).unwrap();
    assert_eq!((store.list().count(), store.room()), (0, room));
    store.release(lease);
    assert_eq!(store.room(), layout().clips.end - layout().clips.start);
    upload(&mut store, 1, &new).unwrap();
    assert_eq!(store.entry(1).unwrap().at, at);
    let leases = [store.lease(1), store.lease(1)].map(Option::unwrap);
    assert!(store.lease(1).is_none(), "two are out");
    leases.into_iter().for_each(|lease| store.release(lease));
    assert!(store.lease(1).is_some());
}

#[test]
fn a_full_directory_says_so() {
    let mut flash = Small::new(SECTORS);
    let clip = vector("dpcm-one-channel.mclip");
    let mut store = mount(&mut flash);
    for number in 0..15 {
        upload(&mut store, number * 7 % 15, &clip).unwrap();
    }
    assert!(store.list().map(|entry| entry.clip).eq(0..15), "by number");
    assert_eq!(store.begin(15, "", 1, 0), Err(StoreError::TooMany { most: 15 }));
    upload(&mut store, 14, &clip).unwrap();
    drop(store);
    assert_eq!(documented(flash.image()), contents(&mut flash));
}

#[test]
fn a_layout_that_does_not_fit_is_refused() {
    for layout in [
        Layout { directory: [0, 0], clips: 2048..4096 },
        Layout { directory: [0, 1024], clips: 1024..4096 },
        Layout { directory: [0, 1024], clips: 2048..2048 },
        Layout { directory: [0, 1024], clips: 2048..4095 },
        Layout { directory: [0, 1024], clips: 2048..27 * 1024 },
        Layout { directory: [26 * 1024, 1024], clips: 2048..4096 },
        Layout { directory: [0, u32::MAX - 1023], clips: 2048..4096 },
    ] {
        let refused = Store::mount(Small::new(SECTORS), layout.clone(), CAPACITY).err();
        assert_eq!(refused, Some(StoreError::Layout), "{layout:?}");
    }
}
