//! The checksum of protocol 2.0: CRC-16, polynomial 0x8005, start value 0, not reflected.

use crc::{CRC_16_UMTS, Crc, Table};

/// The catalogue's CRC-16/UMTS (also "BUYPASS") is the one of the e-Manual; its table is 512 bytes of flash.
static ALGORITHM: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_UMTS);

/// Continues the checksum `crc` over `bytes`; a packet starts with `crc` 0 at its header.
///
/// One table look-up a byte. Continuing is what fast sync read needs: there every servo's checksum covers all
/// bytes sent before it, earlier checksums included.
#[must_use]
pub fn update(crc: u16, bytes: &[u8]) -> u16 {
    let mut digest = ALGORITHM.digest_with_initial(crc);
    digest.update(bytes);
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::update;

    #[test]
    fn is_the_checksum_of_the_catalogue() {
        assert_eq!(update(0, b"123456789"), 0xFEE8);
    }

    #[test]
    fn continues_where_it_stopped() {
        let bytes: Vec<u8> = (0..=255).collect();
        for cut in 0..=bytes.len() {
            assert_eq!(update(update(0, &bytes[..cut]), &bytes[cut..]), update(0, &bytes));
        }
    }
}
