//! A clip into a device's flash.

use super::client::{Client, JOB_TIME, Line, LinkError};
use firmware::demands::Facts;
use firmware::link::frame::crc32;
use firmware::link::message::{ClipInfo, Refusal, Request, Response};
use firmware::store::StoreError;
use std::time::{Duration, Instant};

/// What is uploaded.
#[derive(Clone, Copy, Debug)]
pub struct Upload<'a> {
    /// Its number on the device.
    pub clip: u16,
    /// Its name there, 32 bytes at most.
    pub name: &'a str,
    /// The file's bytes.
    pub bytes: &'a [u8],
}

/// Uploads a clip, and tells `progress` how many bytes the device has. The old clip of that number plays until the new one is whole and
/// checked. Where the device has a part of this very clip it goes on from there.
///
/// # Errors
/// [`LinkError`]; the old clip is still there.
pub fn upload(
    client: &mut Client,
    upload: Upload<'_>,
    progress: &mut dyn FnMut(usize),
) -> Result<(), LinkError> {
    let Upload { clip, name, bytes } = upload;
    check(client, bytes)?;
    let len = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
    let begin = Request::Begin { clip, name, bytes: len, crc: crc32([bytes]) };
    let mut next = wanted(client, &begin)?;
    let most = usize::from(client.hello().data_bytes).max(1);
    let mut stuck = Instant::now();
    while next < len {
        progress(next as usize);
        let rest = bytes.get(next as usize..).unwrap_or_default();
        let data = rest.get(..most).unwrap_or(rest);
        let before = next;
        next = wanted(client, &Request::Data { offset: next, bytes: data })?;
        if next > before {
            stuck = Instant::now();
        } else if stuck.elapsed() > JOB_TIME.max(client.patience()) {
            return Err(client.unexpected(&Response::Upload { next }));
        }
    }
    progress(bytes.len());
    client.request_done(&Request::Commit)
}

/// Whether the puppet can play a clip, asked before a byte of it is sent. A device that does not know the question says so at the
/// end of the upload.
fn check(client: &mut Client, bytes: &[u8]) -> Result<(), LinkError> {
    let demands = match client.request(&Request::Demands) {
        Ok(Response::Demands(demands)) => demands,
        Ok(_) | Err(LinkError::Refused { refusal: Refusal::Unknown, .. }) => return Ok(()),
        Err(error) => return Err(error),
    };
    let Ok(facts) = Facts::of(bytes) else { return Ok(()) };
    let checked = demands.check(&facts).map_err(StoreError::Play).map_err(Refusal::Store);
    checked.map_err(|refusal| LinkError::Refused { port: client.name().to_owned(), refusal })
}

/// Whether an upload goes on already; after a line has broken it may be the own one.
fn is_busy(error: &LinkError) -> bool {
    matches!(error, LinkError::Refused { refusal: Refusal::Store(StoreError::Busy), .. })
}

/// The byte that the device wants next.
fn wanted(client: &mut Client, request: &Request<'_>) -> Result<u32, LinkError> {
    match client.request_until_ready(request)? {
        Response::Upload { next } => Ok(next),
        other => Err(client.unexpected(&other)),
    }
}

/// Uploads over new lines where one breaks, for as long as `patience` after the last progress.
///
/// # Errors
/// As [`upload`], and the last line's error.
pub fn upload_again(
    line: Line<'_>,
    what: Upload<'_>,
    patience: Duration,
    progress: &mut dyn FnMut(usize),
) -> Result<(), LinkError> {
    let (mut advanced, mut most) = (Instant::now(), 0);
    loop {
        let mut told = |bytes: usize| {
            if bytes > most {
                (advanced, most) = (Instant::now(), bytes);
            }
            progress(bytes);
        };
        let result = Client::open(line).and_then(|mut client| upload(&mut client, what, &mut told));
        match result {
            Err(error)
                if (error.is_broken()
                    || most > 0 && (matches!(error, LinkError::Open { .. }) || is_busy(&error)))
                    && advanced.elapsed() < patience =>
            {
                std::thread::sleep(Duration::from_millis(100));
            }
            result => return result,
        }
    }
}

/// The clips of a device.
///
/// # Errors
/// [`LinkError`].
pub fn list(client: &mut Client) -> Result<Vec<ClipInfo>, LinkError> {
    let mut clips = Vec::new();
    for index in 0..=u16::MAX {
        match client.request(&Request::Clip { index })? {
            Response::Clip(Some(clip)) => clips.push(clip),
            Response::Clip(None) => break,
            other => return Err(client.unexpected(&other)),
        }
    }
    Ok(clips)
}
