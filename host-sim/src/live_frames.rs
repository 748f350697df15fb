//! Where live frames come from: a serial port, a TCP connection, a pseudo terminal, or whoever connects by TCP or WebSocket.
//!
//! Whatever it is, its bytes go through a channel, cut as they come; the player looks for frames in them. The Blender add-on Servo
//! Animation has two methods of its live mode: a serial port of this computer, and a WebSocket client, which connects to
//! `ws://HOST:PORT/PATH` and sends one binary message for each servo that moved, with the five bytes of its serial frame
//! (timhendriks93/blender-servo-animation, `addon/ops/start_live_mode.py` and `addon/utils/live_mode.py`).

mod client;
mod listener;

pub use listener::{Listener, Say};

use crate::link::port::Port;
use anyhow::{Context, Result};
use client::CHUNK;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::Duration;

/// Reads the serial port or `tcp:HOST:PORT` of this name in a thread of its own, until it ends.
///
/// # Errors
/// A sentence where it cannot be opened.
pub fn read_port(name: &str, baud: u32, say: Say) -> Result<Receiver<Vec<u8>>> {
    let mut port = Port::open(name, baud).with_context(|| format!("cannot open {name}"))?;
    let (sender, receiver) = channel();
    let name = name.to_owned();
    thread::spawn(move || {
        let mut bytes = [0; CHUNK];
        loop {
            let sent = match port.read(&mut bytes, Duration::from_secs(1)) {
                Ok(count) => sender.send(bytes[..count].to_vec()),
                Err(error) => return say(&format!("{name}: {error}: no more frames will come")),
            };
            if sent.is_err() {
                return;
            }
        }
    });
    Ok(receiver)
}

/// Opens a pseudo terminal, reads it in a thread of its own, and gives the path that frames are to be written to.
///
/// # Errors
/// A sentence where this system has none.
pub fn read_pty(say: Say) -> Result<(PathBuf, Receiver<Vec<u8>>)> {
    let (sender, receiver) = channel();
    Ok((pty(sender, say)?, receiver))
}

#[cfg(unix)]
fn pty(sender: Sender<Vec<u8>>, say: Say) -> Result<PathBuf> {
    use std::io::ErrorKind;
    let mut pty = virtual_servos::serve::Pty::open()?;
    let path = pty.path().to_owned();
    thread::spawn(move || {
        let mut bytes = [0; CHUNK];
        loop {
            match pty.read_now(&mut bytes) {
                Ok(count) if sender.send(bytes[..count].to_vec()).is_err() => return,
                Ok(_) => {}
                Err(error) if [ErrorKind::WouldBlock, ErrorKind::Interrupted].contains(&error.kind()) => {
                    thread::sleep(Duration::from_millis(1));
                }
                Err(error) => {
                    return say(&format!("the pseudo terminal failed: {error}: no more frames will come"));
                }
            }
        }
    });
    Ok(path)
}

#[cfg(not(unix))]
fn pty(_: Sender<Vec<u8>>, _: Say) -> Result<PathBuf> {
    anyhow::bail!("this system has no pseudo terminals: give a serial port, tcp:HOST:PORT, or --listen")
}
