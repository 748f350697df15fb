//! A device on a thread, and lines to it that break when they are told to.

use host_sim::device::{Config, Listener, run_device};
use mocap::skeleton::Skeleton;
use puppet_file::{Map, Puppet};
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

/// A puppet of the workspace that eases in no time to wait for.
pub fn map(puppet: &str, skeleton: &Skeleton) -> Map {
    let path = bunraku_tests::workspace().join("puppets").join(puppet);
    let text = std::fs::read_to_string(&path).unwrap();
    let text = format!("ease_seconds = 0.2\nease_speed = 1.0\n{text}");
    Puppet::parse(Path::new("puppet.toml"), text).unwrap().map(skeleton).unwrap()
}

/// Runs a device while `test` does, which is given its port.
pub fn with_device(map: &Map, config: &Config, test: impl FnOnce(&str)) {
    let listener = Listener::tcp("127.0.0.1:0").unwrap();
    let (port, ended) = (listener.name().unwrap(), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let device = scope.spawn(|| run_device(map, config, listener, &|| ended.load(Ordering::Relaxed)));
        let ends = Ends(&ended);
        test(&port);
        drop(ends);
        device.join().unwrap().unwrap();
    });
}

/// Ends the device also where the test fails, which would wait for it for ever.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Lines to a device that pass bytes on until they are cut.
pub struct Cutter {
    port: String,
    lines: Mutex<Vec<TcpStream>>,
    /// Whether new lines are taken.
    open: AtomicBool,
    /// Bytes to the device after which a line is cut.
    every: AtomicUsize,
    cuts: AtomicUsize,
}

impl Cutter {
    /// Lines to this port, cut after so many bytes each.
    pub fn start(device: &str, every: usize) -> &'static Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let cutter: &'static Self = Box::leak(Box::new(Self {
            port: format!("tcp:{}", listener.local_addr().unwrap()),
            lines: Mutex::new(Vec::new()),
            open: AtomicBool::new(true),
            every: AtomicUsize::new(every),
            cuts: AtomicUsize::new(0),
        }));
        let device = device.strip_prefix("tcp:").unwrap().to_owned();
        std::thread::spawn(move || {
            for host in listener.incoming() {
                let host = host.unwrap();
                if cutter.open.load(Ordering::Relaxed) {
                    cutter.pass(&host, &TcpStream::connect(&device).unwrap());
                }
            }
        });
        cutter
    }

    pub fn port(&self) -> &str {
        &self.port
    }

    pub fn cuts(&self) -> usize {
        self.cuts.load(Ordering::Relaxed)
    }

    /// Cuts all lines, and takes new ones or does not.
    pub fn cut(&self, open: bool) {
        self.open.store(open, Ordering::Relaxed);
        for line in self.lines.lock().unwrap().drain(..) {
            let _ = line.shutdown(Shutdown::Both);
        }
    }

    fn pass(&'static self, host: &TcpStream, device: &TcpStream) {
        let clone = |stream: &TcpStream| stream.try_clone().unwrap();
        self.lines.lock().unwrap().extend([clone(host), clone(device)]);
        let (there, back) = ((clone(host), clone(device)), (clone(device), clone(host)));
        std::thread::spawn(move || self.copy(there, self.every.load(Ordering::Relaxed)));
        std::thread::spawn(move || self.copy(back, usize::MAX));
    }

    fn copy(&self, (mut from, mut to): (TcpStream, TcpStream), mut left: usize) {
        let mut buffer = [0; 700];
        while let Ok(count @ 1..) = from.read(&mut buffer) {
            let count = count.min(left);
            left -= count;
            if to.write_all(&buffer[..count]).is_err() {
                break;
            }
            if left == 0 {
                self.cuts.fetch_add(1, Ordering::Relaxed);
                // What was sent arrives first.
                std::thread::sleep(Duration::from_millis(20));
                break;
            }
        }
        let _ = from.shutdown(Shutdown::Both);
        let _ = to.shutdown(Shutdown::Both);
    }
}
