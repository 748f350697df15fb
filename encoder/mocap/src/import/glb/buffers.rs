//! The bytes of a glTF file: its JSON, its buffers, and the numbers of its accessors.

use std::path::{Component, Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::document::{Buffer, Document, Wrong};
use crate::import::file::read_bytes;

/// The JSON, and the binary chunk of a GLB; of a `.gltf`, the file itself.
pub(super) fn chunks(bytes: &[u8]) -> Option<(&[u8], Option<&[u8]>)> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if text.trim_ascii_start().starts_with(b"{") {
        return Some((text, None));
    }
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    if !bytes.starts_with(b"glTF") || word(4)? != 2 || bytes.get(16..20)? != b"JSON" {
        return None;
    }
    let end = 20_usize.checked_add(word(12)?)?;
    let json = bytes.get(20..end)?;
    let data = match word(end) {
        Some(length) if bytes.get(end + 4..end + 8) == Some(b"BIN\0") => {
            Some(bytes.get(end + 8..)?.get(..length)?)
        }
        _ => None,
    };
    Some((json, data))
}

/// The bytes of the buffers that the animation needs; others, as those of meshes and pictures, stay empty.
pub(super) fn load(
    document: &Document,
    binary: Option<&[u8]>,
    folder: Option<&Path>,
) -> Result<Vec<Vec<u8>>, Wrong> {
    let samplers = document.animations.first().map_or(&[][..], |animation| &animation.samplers);
    let is_needed = |buffer: usize| {
        let accessors = samplers.iter().flat_map(|sampler| [sampler.input, sampler.output]);
        let views = accessors.filter_map(|index| document.accessors.get(index)?.buffer_view);
        views.filter_map(|view| document.buffer_views.get(view)).any(|view| view.buffer == buffer)
    };
    let load = |(index, buffer): (usize, &Buffer)| match &buffer.uri {
        _ if !is_needed(index) => Ok(Vec::new()),
        None if index == 0 => Ok(binary.unwrap_or_default().to_vec()),
        None => Err((format!("buffer {index} without a uri"), "a file or data for each buffer")),
        Some(uri) => of_uri(uri, index, folder),
    };
    document.buffers.iter().enumerate().map(load).collect()
}

fn of_uri(uri: &str, index: usize, folder: Option<&Path>) -> Result<Vec<u8>, Wrong> {
    if let Some(data) = uri.strip_prefix("data:") {
        let text = data.split_once(";base64,").map(|(_, text)| text);
        let bytes = text.and_then(|text| STANDARD.decode(text.trim_end()).ok());
        return bytes.ok_or((format!("data that are not base64 in buffer {index}"), "data:…;base64,…"));
    }
    let shown = uri.escape_debug();
    let beside = "the name of a file in the folder of this one";
    let name = percent_decoded(uri)
        .filter(|name| name.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)))
        .ok_or_else(|| (format!("buffer {index} in {shown}"), beside))?;
    let Some(folder) = folder else {
        return Err((format!("buffer {index} in {shown}"), "all data in the file"));
    };
    let path = folder.join(name);
    // A pipe or a device would never end.
    if !path.is_file() {
        return Err((format!("no file {} for buffer {index}", path.display()), "it beside this one"));
    }
    read_bytes(&path).map_err(|error| (format!("{}, which cannot be read ({error})", path.display()), beside))
}

/// A relative path, in which `%20` is a space.
fn percent_decoded(uri: &str) -> Option<PathBuf> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.bytes();
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'%' => {
                let mut digit = || char::from(rest.next()?).to_digit(16);
                u8::try_from(16 * digit()? + digit()?).ok()?
            }
            _ => byte,
        });
    }
    let name = String::from_utf8(bytes).ok()?;
    // A scheme, as in https:, is no file beside.
    (!name.is_empty() && !name.contains(['\0', ':', '\\'])).then(|| name.into())
}

/// The numbers of an accessor, of which an element has `width`.
pub(super) fn numbers(
    document: &Document,
    accessor: usize,
    width: usize,
    buffers: &[Vec<u8>],
) -> Option<Vec<f64>> {
    let accessor = document.accessors.get(accessor)?;
    let view = document.buffer_views.get(accessor.buffer_view?)?;
    if accessor.sparse.is_some() {
        return None;
    }
    let size = match accessor.component_type {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        5126 => 4,
        _ => return None,
    };
    let data = buffers.get(view.buffer)?;
    let view_bytes = data.get(view.byte_offset..)?.get(..view.byte_length)?.get(accessor.byte_offset..)?;
    let stride = view.byte_stride.unwrap_or(size * width);
    if stride < size * width || accessor.count > view_bytes.len() {
        return None;
    }
    let mut found = Vec::with_capacity(accessor.count * width);
    for element in 0..accessor.count {
        let element = view_bytes.get(element.checked_mul(stride)?..)?.get(..size * width)?;
        for part in element.chunks_exact(size) {
            // Whole numbers stand for -1 to 1, or 0 to 1.
            let value = match (accessor.component_type, part) {
                (5120, &[a]) => (f64::from(a as i8) / 127.0).max(-1.0),
                (5121, &[a]) => f64::from(a) / 255.0,
                (5122, &[a, b]) => (f64::from(i16::from_le_bytes([a, b])) / 32767.0).max(-1.0),
                (5123, &[a, b]) => f64::from(u16::from_le_bytes([a, b])) / 65535.0,
                (_, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
                _ => return None,
            };
            found.push(Some(value).filter(|value| value.is_finite())?);
        }
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn names_of_files_beside() {
        for (uri, name) in
            [("a.bin", "a.bin"), ("./my%20walk.bin", "my walk.bin"), ("data/%C3%A4.bin", "data/ä.bin")]
        {
            assert!(percent_decoded(uri).expect(uri).ends_with(name), "{uri}");
        }
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("a.bin"), [1, 2]).expect("a file");
        assert_eq!(of_uri("a.bin", 0, Some(folder.path())), Ok(vec![1, 2]));
        assert_eq!(of_uri("data:application/octet-stream;base64,AQI=", 0, None), Ok(vec![1, 2]));
        for (uri, message) in [
            ("../a.bin", "buffer 0 in ../a.bin"),
            ("/etc/passwd", "buffer 0 in /etc/passwd"),
            ("https://example.org/a.bin", "buffer 0 in https"),
            ("%2e%2e/a.bin", "buffer 0 in %2e"),
            ("%4", "buffer 0 in %4"),
            ("b.bin", "no file "),
            (".", "no file "),
            ("data:text/plain,1", "data that are not base64"),
        ] {
            let (found, _) = of_uri(uri, 0, Some(folder.path())).expect_err(uri);
            assert!(found.starts_with(message), "{uri}: {found}");
        }
    }
}
