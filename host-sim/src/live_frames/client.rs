//! A connected client: what it speaks, and its bytes.

use anyhow::{Result, anyhow};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::Sender;
use std::thread;
use std::time::Duration;
use tungstenite::handshake::HandshakeError;
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::StatusCode;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, accept_hdr_with_config};

/// Most bytes that are read at once.
pub const CHUNK: usize = 1024;

/// What every WebSocket client sends first (RFC 6455, section 4.1), and no frame begins with.
const HTTP: [u8; 4] = *b"GET ";

/// Time in which a WebSocket client must have said what it wants, and one that is refused must have said anything.
const PATIENCE: Duration = Duration::from_secs(5);

/// Longest message that is taken, in bytes. The add-on's have five.
const MOST: usize = 64 << 10;

/// What a client speaks.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Speaks {
    Frames,
    WebSocket,
    /// It has gone without a word.
    Nothing,
}

/// Sends on what a client sends, until it is gone. `connected` is told what it speaks.
///
/// # Errors
/// Why the connection failed.
pub fn read(stream: TcpStream, frames: &Sender<Vec<u8>>, connected: impl FnOnce(&str)) -> Result<()> {
    stream.set_nodelay(true)?;
    match speaks(&stream)? {
        Speaks::Nothing => Ok(()),
        Speaks::Frames => {
            connected("TCP");
            read_frames(stream, frames)
        }
        Speaks::WebSocket => {
            // A client that stops in the middle of its request would keep the others out.
            stream.set_read_timeout(Some(PATIENCE))?;
            let config = WebSocketConfig::default().max_message_size(Some(MOST)).max_frame_size(Some(MOST));
            let mut socket = accept_hdr_with_config(stream, allowed, Some(config)).map_err(refused)?;
            socket.get_ref().set_read_timeout(None)?;
            connected("WebSocket");
            loop {
                let bytes = match socket.read() {
                    Ok(Message::Binary(bytes)) => bytes.to_vec(),
                    // The add-on sends none; if it is noise, it is counted as such.
                    Ok(Message::Text(text)) => text.as_bytes().to_vec(),
                    Ok(_) => continue,
                    Err(Error::ConnectionClosed | Error::AlreadyClosed) => return Ok(()),
                    Err(error) => return Err(error.into()),
                };
                if frames.send(bytes).is_err() {
                    return Ok(());
                }
            }
        }
    }
}

fn read_frames(mut stream: TcpStream, frames: &Sender<Vec<u8>>) -> Result<()> {
    let mut bytes = [0; CHUNK];
    loop {
        match stream.read(&mut bytes) {
            Ok(0) => return Ok(()),
            Ok(count) if frames.send(bytes[..count].to_vec()).is_err() => return Ok(()),
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error.into()),
        }
    }
}

/// Looks at what a client has sent first, and leaves it there.
fn speaks(stream: &TcpStream) -> io::Result<Speaks> {
    let mut first = [0; HTTP.len()];
    loop {
        let count = stream.peek(&mut first)?;
        if count == 0 {
            return Ok(Speaks::Nothing);
        }
        if first[..count] != HTTP[..count] {
            return Ok(Speaks::Frames);
        }
        if count == HTTP.len() {
            return Ok(Speaks::WebSocket);
        }
        // What has come is not taken, so the next look would not wait for more.
        thread::sleep(Duration::from_millis(1));
    }
}

/// Says why no frames are taken, in the client's own protocol, and hangs up.
pub fn refuse(mut stream: TcpStream, why: &str) {
    let mut answer = || -> io::Result<()> {
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        // One that waits for us to speak first speaks no HTTP.
        match speaks(&stream).unwrap_or(Speaks::Frames) {
            Speaks::Nothing => Ok(()),
            Speaks::Frames => writeln!(stream, "{why}"),
            Speaks::WebSocket => {
                let length = why.len() + 1;
                write!(
                    stream,
                    "HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nContent-Length: {length}\r\n\
                     Connection: close\r\n\r\n{why}\n"
                )
            }
        }
    };
    let mut rest = [0; CHUNK];
    // A connection that is closed with bytes unread is reset, and the answer with it. One that does not hear why is refused all the
    // same.
    let _ = answer().and_then(|()| stream.shutdown(Shutdown::Write)).and_then(|()| stream.read(&mut rest));
}

/// Any page that a browser on this computer shows may connect to its ports, and says where it is from (RFC 6455, section 10.2). The
/// add-on says that it is from here, and other programs say nothing.
#[expect(clippy::result_large_err, reason = "the callback's type is tungstenite's")]
fn allowed(request: &Request, response: Response) -> Result<Response, ErrorResponse> {
    let header = |name| request.headers().get(name).and_then(|value| value.to_str().ok());
    let origin = header("origin").map(|origin| origin.split_once("://").map_or(origin, |(_, host)| host));
    if origin.is_none() || origin == header("host") {
        return Ok(response);
    }
    let mut refusal =
        ErrorResponse::new(Some("a page of another origin may not move the puppet\n".to_owned()));
    *refusal.status_mut() = StatusCode::FORBIDDEN;
    Err(refusal)
}

/// Why there is no WebSocket.
fn refused<R: tungstenite::handshake::HandshakeRole>(error: HandshakeError<R>) -> anyhow::Error {
    match error {
        HandshakeError::Failure(Error::Http(answer)) if answer.status() == StatusCode::FORBIDDEN => {
            anyhow!("it is a page of another origin, and was refused")
        }
        HandshakeError::Failure(error) => anyhow!("it asked for no WebSocket: {error}"),
        HandshakeError::Interrupted(_) => {
            anyhow!("it did not ask for a WebSocket within {} s", PATIENCE.as_secs())
        }
    }
}
