//! Memory for UART drivers that buffer.

/// What waits to be sent, and what was received.
pub type Buffers = (&'static mut [u8], &'static mut [u8]);

/// For the servo bus: a packet with the goals of 32 servos, and the answers of 32 servos, each with bytes to spare. Panics the
/// second time: there is one bus.
pub fn buffers() -> Buffers {
    let sent = cortex_m::singleton!(: [u8; 256] = [0; 256]);
    let received = cortex_m::singleton!(: [u8; 1024] = [0; 1024]);
    both(sent, received)
}

/// For a host's line: what 50 ms at 230,400 bit/s bring. Panics the second time: there is one line.
#[cfg(feature = "link")]
pub fn host_buffers() -> Buffers {
    let sent = cortex_m::singleton!(: [u8; 1152] = [0; 1152]);
    let received = cortex_m::singleton!(: [u8; 1152] = [0; 1152]);
    both(sent, received)
}

fn both<const S: usize, const R: usize>(
    sent: Option<&'static mut [u8; S]>,
    received: Option<&'static mut [u8; R]>,
) -> Buffers {
    match (sent, received) {
        (Some(sent), Some(received)) => (sent, received),
        _ => defmt::panic!("the line has its buffers already"),
    }
}
