//! What an image writes to semihosting's standard output: defmt frames, or plain text.

use anyhow::{Result, anyhow, bail};
use defmt_decoder::{DecodeError, Frame, Location, Locations, Table};

/// Turns the bytes that an image writes into lines.
pub struct Log {
    kind: Kind,
    pending: Vec<u8>,
}

enum Kind {
    /// Text, line by line.
    Text,
    /// defmt frames; what they mean is in the image.
    Defmt { table: Table, locations: Locations },
}

impl Log {
    /// The log of the image with these bytes: defmt where the image has defmt's section, else text.
    ///
    /// # Errors
    /// Where the bytes are no ELF file, or its defmt section is of an unknown version.
    pub fn new(elf: &[u8]) -> Result<Self> {
        let kind =
            match Table::parse(elf).map_err(|error| anyhow!("not an image that can be run: {error:#}"))? {
                None => Kind::Text,
                Some(table) => {
                    // Places are known only where the image has debug info.
                    let locations = table.get_locations(elf).unwrap_or_default();
                    Kind::Defmt { table, locations }
                }
            };
        Ok(Self { kind, pending: Vec::new() })
    }

    /// Takes bytes and gives the lines that are complete with them.
    ///
    /// # Errors
    /// Where the bytes are not those of the image's log.
    pub fn take(&mut self, bytes: &[u8], line: &mut dyn FnMut(&str)) -> Result<()> {
        self.pending.extend_from_slice(bytes);
        match &self.kind {
            Kind::Text => {
                while let Some(end) = self.pending.iter().position(|&byte| byte == b'\n') {
                    let text: Vec<u8> = self.pending.drain(..=end).collect();
                    line(String::from_utf8_lossy(&text).trim_end());
                }
            }
            // rzCOBS, defmt's default encoding, ends every frame with a 0.
            Kind::Defmt { table, locations } => {
                let whole = self.pending.iter().rposition(|&byte| byte == 0).map_or(0, |end| end + 1);
                let frames: Vec<u8> = self.pending.drain(..whole).collect();
                let mut decoder = table.new_stream_decoder();
                decoder.received(&frames);
                loop {
                    match decoder.decode() {
                        Ok(frame) => line(&sentence(&frame, locations.get(&frame.index()))),
                        Err(DecodeError::UnexpectedEof) => break,
                        Err(DecodeError::Malformed) => bail!("the image wrote a log that is not defmt"),
                    }
                }
            }
        }
        Ok(())
    }
}

/// A frame as a line: errors and warnings say where they come from.
fn sentence(frame: &Frame<'_>, location: Option<&Location>) -> String {
    let message = frame.display_message();
    let Some(level) = frame.level().map(|level| level.as_str()) else {
        return message.to_string();
    };
    match location {
        Some(Location { file, line, .. }) if level == "warn" || level == "error" => {
            let file = file.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
            format!("{level}: {message} ({file}:{line})")
        }
        _ => format!("{level}: {message}"),
    }
}
