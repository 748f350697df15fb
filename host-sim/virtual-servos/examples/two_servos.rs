//! Serves two Dynamixel X on a pseudo terminal and prints every goal that they take, until it is stopped.

#[cfg(unix)]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    use std::time::Instant;
    use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
    use virtual_servos::serve::{BYTE_GAP_US, Pty, Served};

    let config = DynamixelConfig { byte_gap_us: BYTE_GAP_US, ..DynamixelConfig::with_ids(&[1, 2]) };
    let bus = Box::new(DynamixelServos::new(&config)?);
    let tap = Box::new(|event| println!("{event:?}"));
    let mut pty = Pty::open()?;
    println!("servos 1 and 2 are on {}", pty.path().display());
    Ok(pty.serve(Served { bus, power_on: Instant::now(), tap })?)
}

#[cfg(not(unix))]
fn main() {
    eprintln!("this system has no pseudo terminals: see virtual_servos::serve::Tcp");
}
