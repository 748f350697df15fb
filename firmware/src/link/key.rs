//! Lines that need a key: who has it proves that on hello, without sending it.
//!
//! The device draws a nonce for each hello; the host answers with HMAC-SHA-256 of nonce and session under the key. What is
//! said afterwards is neither secret nor signed: the key keeps out those who can only open connections.

use core::fmt::Debug;
use heapless::Vec;
use hmac::{Hmac, Mac};
use sha2::Sha256;

/// Fewest and most bytes of a key.
pub const KEY_BYTES: core::ops::RangeInclusive<usize> = 16..=64;

/// Bytes of a nonce.
pub const NONCE_BYTES: usize = 16;

/// Bytes of a proof.
pub const PROOF_BYTES: usize = 32;

/// What a proof is about besides the session.
pub type Nonce = Vec<u8, NONCE_BYTES>;

/// What proofs begin with, so that they are of no use elsewhere.
const PROOF: &[u8] = b"bunraku link 1 proof";

/// What nonces are made of.
const NONCE: &[u8] = b"bunraku link 1 nonce";

/// A key. A line has a reference to one, so that those without need neither memory nor code for it.
pub trait Lock: Debug + Sync {
    /// What follows from these parts, one behind the other, and the key.
    fn digest(&self, parts: [&[u8]; 3]) -> [u8; PROOF_BYTES];
}

/// A key for HMAC-SHA-256 (RFC 2104 and FIPS 180-4).
pub struct HmacKey(Vec<u8, { *KEY_BYTES.end() }>);

impl HmacKey {
    /// A key of these bytes; `None` where they are too few or too many ([`KEY_BYTES`]).
    pub fn new(bytes: &[u8]) -> Option<Self> {
        let key = KEY_BYTES.contains(&bytes.len()).then(|| Vec::from_slice(bytes).ok());
        key.flatten().map(Self)
    }
}

impl Debug for HmacKey {
    /// Without the key.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("HmacKey")
    }
}

impl Lock for HmacKey {
    fn digest(&self, parts: [&[u8]; 3]) -> [u8; PROOF_BYTES] {
        // A key of any length is one of HMAC.
        let Ok(mut mac) = Hmac::<Sha256>::new_from_slice(&self.0) else { return [0; PROOF_BYTES] };
        parts.iter().for_each(|part| mac.update(part));
        mac.finalize().into_bytes().into()
    }
}

/// The proof of a session's host.
pub fn proof(lock: &dyn Lock, nonce: &[u8], session: u32) -> [u8; PROOF_BYTES] {
    lock.digest([PROOF, nonce, &session.to_le_bytes()])
}

/// Nonce `count` since the device was turned on, where `seed` was drawn then.
pub(super) fn nonce(lock: &dyn Lock, seed: u64, count: u32) -> Nonce {
    let digest = lock.digest([NONCE, &seed.to_le_bytes(), &count.to_le_bytes()]);
    digest.iter().copied().take(NONCE_BYTES).collect()
}

/// Whether this is the proof. Takes as long for a wrong one.
pub(super) fn is_proven(lock: &dyn Lock, nonce: &[u8], session: u32, found: &[u8]) -> bool {
    let expected = proof(lock, nonce, session);
    let differing = expected.iter().zip(found).fold(0, |bits, (a, b)| bits | (a ^ b));
    found.len() == expected.len() && core::hint::black_box(differing) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By Python's `hmac.new(key, message, "sha256")`.
    #[test]
    fn a_proof_is_the_hmac_of_the_page() {
        let key = HmacKey::new(b"0123456789abcdef").unwrap();
        let nonce: std::vec::Vec<u8> = (0..16).collect();
        let hex = |bytes: &[u8]| {
            bytes.iter().map(|byte| std::format!("{byte:02x}")).collect::<std::vec::Vec<_>>().concat()
        };
        assert_eq!(
            hex(&proof(&key, &nonce, 0x1234_5678)),
            "e1745b32dea199b2eb34262a139cb127821643a04c8bb9ff0c3f6bcd1d05ab51"
        );
        let page = crate::link::examples::document();
        let spaced: std::vec::Vec<_> =
            proof(&key, &nonce, 0x1234_5678).iter().map(|byte| std::format!("{byte:02x}")).collect();
        assert!(page.contains(&spaced.join(" ")), "docs/LINK.md has another proof");
        assert!(is_proven(&key, &nonce, 7, &proof(&key, &nonce, 7)));
        let right = proof(&key, &nonce, 7);
        assert!(!is_proven(&key, &nonce, 8, &right));
        assert!(!is_proven(&key, &nonce, 7, &right[..31]) && !is_proven(&key, &nonce, 7, &[]));
        for bit in 0..256 {
            let mut wrong = right;
            wrong[bit / 8] ^= 1 << (bit % 8);
            assert!(!is_proven(&key, &nonce, 7, &wrong));
        }
        assert_ne!(super::nonce(&key, 1, 2), super::nonce(&key, 1, 3));
        assert_ne!(super::nonce(&key, 1, 2), super::nonce(&key, 2, 2));
    }

    #[test]
    fn keys_have_a_length_and_are_not_printed() {
        for (length, is_one) in [(0, false), (15, false), (16, true), (64, true), (65, false)] {
            assert_eq!(HmacKey::new(&std::vec![b'k'; length]).is_some(), is_one, "{length}");
        }
        let key = HmacKey::new(&[b'k'; 16]).unwrap();
        assert!(!std::format!("{key:?}").contains("107"));
    }
}
