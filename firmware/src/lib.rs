//! Plays decoded motion on servos: player, joint map, limits and servo buses.
//!
//! `no_std`, no allocation; everything that decides is plain code that is tested on the host.
//!
//! A clip on a servo that is a list in memory:
//!
//! ```
//! use decoder_core::mclip::{Clip, Workspace};
//! use decoder_core::{I16F16, Limits};
//! use firmware::control_loop::{Surroundings, control_loop};
//! use firmware::decoder_list::SingleClip;
//! use firmware::fault::Feedback;
//! use firmware::library::Library;
//! use firmware::machine::{Machine, Show, Start};
//! use firmware::map::{BusKind, BusSpec, Idle, Joint, JointMap, Settings};
//! use servo_wire::bus::{BusError, Goal, ServoBus};
//!
//! /// A hobby servo that keeps every pulse it was told, in microseconds.
//! #[derive(Default)]
//! struct Pulses(Vec<i32>);
//!
//! impl ServoBus for Pulses {
//!     async fn ping(&mut self, _: &[u8], _: usize) -> Result<(), BusError> {
//!         Ok(())
//!     }
//!     async fn set_torque(&mut self, _: &[u8], _: usize, _: bool) -> Result<(), BusError> {
//!         Ok(())
//!     }
//!     async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
//!         self.0.extend(goals.iter().map(|goal| goal.position));
//!         Ok(())
//!     }
//! }
//!
//! /// Nobody commands this puppet, and no tick is late. It plays until it rests.
//! struct Alone;
//!
//! impl<L: Library> Surroundings<L, 1> for Alone {
//!     async fn wait(&mut self, _tick: u32) -> bool {
//!         false
//!     }
//!     fn control(&mut self, machine: &mut Machine<'_, L, 1>, _: &Feedback<'_>) -> bool {
//!         !machine.at_rest()
//!     }
//!     fn feed(&mut self) {}
//! }
//!
//! // Eight seconds of a puppet that walks and waves. Channel 3 lifts its right arm sideways.
//! let bytes = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../decoder-core/examples/clip.mclip"));
//! let clip = Clip::parse(bytes, Limits::MAX)?.verify()?;
//! let mut memory = Workspace::<12, 0, 2048>::EMPTY;
//! let clips = SingleClip::new(clip.decoder(memory.lend())?, None);
//!
//! // 50 ticks a second. Velocities and accelerations are in 1/1024 µs a tick.
//! let joint = Joint {
//!     channel: 3,
//!     bus: 0,
//!     id: 0,
//!     zero: 1500,
//!     home: 1500,
//!     scale: I16F16::from_num(5),
//!     min: 700,
//!     max: 2300,
//!     max_velocity: 60 << 10,
//!     max_acceleration: 20 << 10,
//!     idle: Idle::default(),
//! };
//! let buses = [BusSpec { kind: BusKind::Pwm, baud: 50 }].into_iter().collect();
//! let map = JointMap::new(Settings::new(50), buses, [joint].into_iter().collect()).unwrap();
//!
//! let show = Show { playlist: &[0], ..Show::default() };
//! let mut machine = Machine::new(&map, clips, show, Start::Power);
//! let mut servo = Pulses::default();
//! let ticks = embassy_futures::block_on(control_loop(&mut machine, &mut servo, &mut Alone));
//!
//! // The arm was up for a while, never beyond its range, and is back.
//! assert!(ticks > 8 * 50);
//! assert!(servo.0.iter().all(|pulse| (700..=2300).contains(pulse)));
//! assert!(servo.0.iter().any(|pulse| pulse.abs_diff(1500) > 300));
//! assert_eq!(servo.0.last(), Some(&1500));
//! # Ok::<(), decoder_core::Error>(())
//! ```
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic
    )
)]

pub mod bus;
pub mod clips;
pub mod clock;
mod collect;
pub mod control_loop;
pub mod decoder_list;
pub mod demands;
pub mod device;
pub mod fault;
pub mod follow;
pub mod frames;
pub mod idle;
pub mod interpolate;
pub mod library;
pub mod limits;
pub mod link;
pub mod machine;
pub mod map;
pub mod mixer;
pub mod numbered;
pub mod play_error;
pub mod playback;
pub mod script;
pub mod sender;
pub mod show;
pub mod store;
pub mod stream;
pub mod wearable;
