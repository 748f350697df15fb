//! Memory for UART drivers that buffer.

/// Bytes of a packet with the goals of 32 servos, and to spare.
const SENT: usize = 256;

/// Bytes of the answers of 32 servos, and to spare.
const RECEIVED: usize = 1024;

/// What waits to be sent, and what was received. Panics the second time: there is one bus.
pub fn buffers() -> (&'static mut [u8], &'static mut [u8]) {
    let sent = cortex_m::singleton!(: [u8; SENT] = [0; SENT]);
    let received = cortex_m::singleton!(: [u8; RECEIVED] = [0; RECEIVED]);
    match (sent, received) {
        (Some(sent), Some(received)) => (sent, received),
        _ => defmt::panic!("the bus has its buffers already"),
    }
}
