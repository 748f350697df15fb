//! Plays decoded motion on servos: player, joint map, limits and servo buses.
//!
//! `no_std`, no allocation; everything that decides is plain code that is tested on the host.
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
