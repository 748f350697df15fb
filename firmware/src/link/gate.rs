//! Who gets in on a line: a challenge for each hello, where the line needs a key.

use super::key::{Lock, Nonce, is_proven, nonce};

/// The door of a line.
#[derive(Debug)]
pub(super) struct Gate {
    /// The key that the line needs, and what was drawn when the device was turned on.
    lock: Option<(&'static dyn Lock, u64)>,
    /// Challenges so far.
    challenges: u32,
    /// The session that the last one was for, and its nonce, while no proof has come.
    challenged: Option<(u32, Nonce)>,
}

impl Gate {
    /// A door that is open.
    pub const fn open() -> Self {
        Self { lock: None, challenges: 0, challenged: None }
    }

    /// A door that needs a key.
    pub fn locked(lock: &'static dyn Lock, seed: u64) -> Self {
        Self { lock: Some((lock, seed)), ..Self::open() }
    }

    /// The session that was challenged and has not answered.
    pub fn challenged(&self) -> Option<u32> {
        self.challenged.as_ref().map(|(session, _)| *session)
    }

    /// A challenge for a session; `None` where the door is open.
    pub fn challenge(&mut self, session: u32) -> Option<Nonce> {
        let (lock, seed) = self.lock?;
        self.challenges = self.challenges.wrapping_add(1);
        let nonce = nonce(lock, seed, self.challenges);
        self.challenged = Some((session, nonce.clone()));
        Some(nonce)
    }

    /// The session whose challenge this answers. A challenge is answered once.
    pub fn prove(&mut self, proof: &[u8]) -> Option<u32> {
        let ((lock, _), (session, nonce)) = (self.lock?, self.challenged.take()?);
        is_proven(lock, &nonce, session, proof).then_some(session)
    }

    /// Forgets a challenge.
    pub fn forget(&mut self) {
        self.challenged = None;
    }
}
