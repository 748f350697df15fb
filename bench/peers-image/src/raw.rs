//! Plays int16 frames as they are.
#![no_std]
#![no_main]

#[path = "../../../tests/profile-image/src/ends.rs"]
mod ends;
#[path = "../../../tests/profile-image/src/loaded.rs"]
mod loaded;
mod player;

use player::FRAME;

struct Store {
    rest: &'static [u8],
}

impl Store {
    fn new(bytes: &'static [u8]) -> Option<Self> {
        Some(Self { rest: bytes })
    }

    fn frame(&mut self) -> Option<&[u8]> {
        let (frame, rest) = self.rest.split_at_checked(FRAME)?;
        self.rest = rest;
        Some(frame)
    }
}
