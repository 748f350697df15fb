//! Clips of all kinds on one puppet: linked, stored, streamed.
#![allow(clippy::unwrap_used)]

use bunraku_tests::live::{Space, clips, with_clips};
use bunraku_tests::{mclip, vectors};
use decoder_core::mclip::checksum;
use decoder_core::{Error, I16F16};
use firmware::clips::{Clips, LIVE};
use firmware::fault::{Fault, Feedback};
use firmware::frames::Frames;
use firmware::library::Library;
use firmware::machine::{Action, Command, Machine, Show, Start, State, TickOutput};
use firmware::map::{BusKind, BusSpec, Idle, Joint, JointMap, Settings};
use firmware::play_error::PlayError;
use firmware::store::{Layout, Status, Store};
use host_sim::flash::Flash;
use servo_wire::bus::{Goal, Reading};
use sha2::{Digest, Sha256};

fn leak(bytes: &[u8]) -> &'static [u8] {
    Box::leak(bytes.to_vec().into_boxed_slice())
}

fn sha256<F: Frames>(frames: &mut F) -> String {
    let mut sha = Sha256::new();
    while let Some(frame) = frames.next_frame().unwrap() {
        frame.iter().for_each(|value| sha.update(value.to_bits().to_le_bytes()));
    }
    vectors::hex(sha)
}

fn store() -> Store<Flash<4096>> {
    let layout = Layout { directory: [0, 4096], clips: 8192..524_288 };
    Store::mount(Flash::new(128), layout, Space::CAPACITY).unwrap()
}

/// The golden vectors, one after the other and two at a time, in the memory of two decoders.
#[test]
fn decoders_lend_their_memory_to_one_clip_after_the_other() {
    let all: Vec<_> = mclip::all().into_iter().chain(vectors::all()).collect();
    let linked: Vec<&'static [u8]> = all.iter().map(|vector| leak(&vector.bytes)).collect();
    let (mut played, mut refused) = (0, 0);
    with_clips(0, &linked, None, |mut library, _| {
        for round in 0..3 {
            for (index, vector) in all.iter().enumerate() {
                let number = index as u16;
                let mut frames = match library.open(number) {
                    Ok(frames) => frames,
                    Err(PlayError::Clip(Error::Limit { .. } | Error::OutputTooSmall { .. })) => {
                        refused += 1;
                        continue;
                    }
                    Err(error) => panic!("{}: {error}", vector.name),
                };
                let other = library.open((number + round) % all.len() as u16).ok();
                if other.is_some() {
                    assert_eq!(library.open(number).err(), Some(PlayError::NoDecoder));
                }
                assert_eq!(sha256(&mut frames), vector.sha256, "{}", vector.name);
                // And from the middle, as far back as it takes.
                let middle = frames.frames() / 2;
                frames.approach(middle);
                assert!(frames.position() <= middle);
                while frames.position() <= middle {
                    assert!(frames.next_frame().unwrap().is_some());
                }
                frames.approach(0);
                assert_eq!((frames.position(), sha256(&mut frames)), (0, vector.sha256.clone()));
                other.into_iter().for_each(|other| library.close(other));
                library.close(frames);
                played += 1;
            }
        }
        assert_eq!(library.open(all.len() as u16).err(), Some(PlayError::NoClip { clip: all.len() as u16 }));
        assert_eq!(library.open(LIVE).err(), Some(PlayError::NoDecoder), "nothing is streamed");
    });
    println!("{played} clips played, {refused} refused as too large");
    assert!(played > 100 && refused > 0);
}

const SERVOS: usize = 20;

/// Twenty servos on a clip's channels from 6 on, of 5 degrees a tick at most.
fn map() -> JointMap<SERVOS> {
    let joint = |index: usize| Joint {
        channel: 6 + index as u16,
        bus: 0,
        id: index as u8 + 1,
        zero: 2048,
        home: 2048,
        scale: I16F16::from_num(4096.0 / 360.0),
        min: 0,
        max: 4095,
        max_velocity: 57 << 10,
        max_acceleration: 20 << 10,
        idle: Idle::default(),
    };
    let buses = [BusSpec { kind: BusKind::Dynamixel, baud: 1_000_000 }].into_iter().collect();
    JointMap::new(Settings::new(100), buses, (0..SERVOS).map(joint).collect()).unwrap()
}

/// A puppet of servos that are at once where they are told to be.
struct World<'m, 't, 's> {
    machine: Machine<'m, Clips<'t, 's, Flash<4096>>, SERVOS>,
    goals: Vec<Goal>,
    torque: [bool; SERVOS],
    acted: Option<Action>,
}

impl<'t, 's> World<'_, 't, 's> {
    fn tick(&mut self) {
        let reading = |servo: usize| Reading {
            position: self.goals.get(servo).map_or(2048, |goal| goal.position),
            temperature: None,
            millivolts: None,
            load: None,
            hardware_error: 0,
            torque: Some(self.torque[servo]),
        };
        let readings: Vec<_> = (0..SERVOS).map(|servo| Some(reading(servo))).collect();
        let action = self.acted.map(|_| Ok(()));
        let feedback = Feedback { readings: &readings, bus: Ok(()), action, late: false };
        let TickOutput { goals, action } = self.machine.tick(&feedback);
        for (now, last) in goals.iter().zip(&self.goals) {
            assert!((now.position - last.position).abs() <= 58, "servo {}", now.id);
            assert!((0..=4095).contains(&now.position));
        }
        if !goals.is_empty() {
            self.goals = goals.to_vec();
        }
        if let Some(Action::TorqueOn { servo }) = action {
            self.torque[servo] = true;
        }
        self.acted = action;
    }

    fn store(&mut self) -> &mut Store<Flash<4096>> {
        self.machine.library().store().unwrap()
    }

    /// One operation of the store a tick, until it has no more to do; gives how many ticks that were.
    fn finish(&mut self) -> u32 {
        for ticks in 1.. {
            self.tick();
            if let Status::Idle | Status::Receiving { .. } = self.store().step().unwrap() {
                return ticks;
            }
        }
        0
    }

    /// An upload as a link makes it, a message a tick.
    fn upload(&mut self, clip: u16, bytes: &[u8]) -> u32 {
        self.store().begin(clip, "clip", bytes.len() as u32, checksum(bytes, &[])).unwrap();
        let mut ticks = self.finish();
        for (index, chunk) in bytes.chunks(256).enumerate() {
            self.store().write(index as u32 * 256, chunk).unwrap();
            self.tick();
            ticks += 1;
        }
        self.store().commit().unwrap();
        ticks + self.finish()
    }

    fn clip(&self) -> Option<u16> {
        self.machine.mixer().position().map(|(clip, ..)| clip)
    }
}

/// A puppet plays a clip out of flash while a new one is uploaded in its place, and another one removed; then the new one; then a
/// stream, whose sender goes silent.
#[test]
fn a_puppet_plays_what_is_stored_and_what_is_streamed() {
    let Some(clips) = clips(4, 10.0) else { return };
    let [old, new] = [0, 2].map(|clip| clips[clip].bytes());
    let map = map();
    with_clips(6000, &[], Some(store()), |library, live| {
        let machine = Machine::new(&map, library, Show::default(), Start::Power);
        let mut world = World { machine, goals: vec![], torque: [false; SERVOS], acted: None };
        world.upload(0, &old);
        world.machine.command(Command::Play { clip: 0, repeats: true }).unwrap();
        (0..600).for_each(|_| world.tick());
        assert_eq!((world.machine.state(), world.clip()), (State::Playing, Some(0)));
        // The clip that plays is replaced: it goes on, and the next time the new one plays.
        let ticks = world.upload(0, &new);
        println!("an upload of {} bytes took {ticks} ticks", new.len());
        assert_eq!(world.store().get(0), Some(&new[..]));
        world.upload(7, &old);
        world.store().remove(7).unwrap();
        world.finish();
        (0..2000).for_each(|_| world.tick());
        assert_eq!((world.machine.state(), world.machine.fault()), (State::Playing, None));
        world.machine.command(Command::Play { clip: 0, repeats: true }).unwrap();
        (0..300).for_each(|_| world.tick());
        let frames = clips[2].frames.len() as u32;
        let (_, frame, _) = world.machine.mixer().position().unwrap();
        assert!(frame < frames && world.machine.fault().is_none());

        // A stream, which the clip fades into; every fifth block is lost.
        let sender = &clips[3];
        live.begin(sender.header.len() as u32).unwrap();
        assert_eq!(live.header(0, &sender.header), Ok(true));
        world.machine.command(Command::Play { clip: LIVE, repeats: false }).unwrap();
        let mut sent = 0;
        let mut silent = 0;
        while world.machine.fault().is_none() {
            let progress = live.progress();
            // The sender stops in the middle.
            while sent < sender.blocks.len() / 2
                && progress.free_blocks > 0
                && sender.frames_of(sent).0 as u32 <= progress.position + 48
            {
                if sent % 5 != 4 {
                    live.receive(&sender.blocks[sent]).unwrap();
                }
                sent += 1;
            }
            if sent == sender.blocks.len() / 2 {
                silent += 10;
            }
            if live.lost(10) {
                world.machine.command(Command::LinkLost).unwrap();
            }
            world.tick();
            assert!(silent < 2000);
        }
        let counters = live.counters();
        println!("{counters:?}, silent for {silent} ms");
        assert!(counters.played > 200 && counters.concealed > 50 && counters.eased > 50);
        assert_eq!(world.machine.fault(), Some(Fault::LinkLost));
        (0..100).for_each(|_| world.tick());
        assert_eq!(world.machine.state(), State::Holding);
        // The stream is let go of at a stop, and another one can begin.
        world.machine.command(Command::Stop).unwrap();
        (0..10).for_each(|_| world.tick());
        assert_eq!(live.begin(10), Ok(()));
    });
}
