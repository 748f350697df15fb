//! Takes one client at a time, and refuses the others in a sentence.

use super::client;
use anyhow::{Context, Result};
use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

/// Is told what happens, in a sentence.
pub type Say = fn(&str);

/// A TCP port that takes live frames, as bytes or in a WebSocket: what a client sends first says which.
#[derive(Debug)]
pub struct Listener(TcpListener);

/// The client whose frames are taken.
type Current = Arc<Mutex<Option<SocketAddr>>>;

impl Listener {
    /// Listens on this address; port 0 is any free one.
    ///
    /// # Errors
    /// A sentence that names the address.
    pub fn bind(address: SocketAddr) -> Result<Self> {
        TcpListener::bind(address).map(Self).with_context(|| format!("cannot listen on {address}"))
    }

    /// The address that clients connect to.
    ///
    /// # Errors
    /// What the system says.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.0.local_addr()
    }

    /// Takes clients in threads of its own, until the program ends. `say` is told who comes, who goes, and who is refused.
    pub fn start(self, say: Say) -> Receiver<Vec<u8>> {
        let (sender, receiver) = channel();
        let current = Current::default();
        thread::spawn(move || {
            loop {
                match self.0.accept() {
                    Ok((stream, peer)) => {
                        let (sender, current) = (sender.clone(), Arc::clone(&current));
                        thread::spawn(move || attend(stream, peer, &current, &sender, say));
                    }
                    Err(error) => say(&format!("a client could not connect: {error}")),
                }
            }
        });
        receiver
    }
}

/// Takes a client's frames until it is gone, or refuses it.
fn attend(stream: TcpStream, peer: SocketAddr, current: &Current, frames: &Sender<Vec<u8>>, say: Say) {
    // Nothing panics while it has the lock; and if it did, the address in it would still be right.
    let lock = || current.lock().unwrap_or_else(PoisonError::into_inner);
    let there = *lock().get_or_insert(peer);
    if there != peer {
        say(&format!("{peer} was refused: {there} is connected already"));
        return client::refuse(
            stream,
            &format!("{there} is connected already, and one at a time can be followed"),
        );
    }
    let ended = client::read(stream, frames, |how| say(&format!("{peer} is connected by {how}")));
    *lock() = None;
    match ended {
        Ok(()) => say(&format!("{peer} is gone: the pose is held")),
        Err(error) => say(&format!("{peer} is gone, the pose is held: {error:#}")),
    }
}
