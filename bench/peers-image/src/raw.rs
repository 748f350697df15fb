//! Frames as they are.

use crate::FRAME;

pub struct Store {
    rest: &'static [u8],
}

impl Store {
    pub fn new(bytes: &'static [u8]) -> Option<Self> {
        Some(Self { rest: bytes })
    }

    pub fn frame(&mut self) -> Option<&[u8]> {
        let (frame, rest) = self.rest.split_at_checked(FRAME)?;
        self.rest = rest;
        Some(frame)
    }
}
