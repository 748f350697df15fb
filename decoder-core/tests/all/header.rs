//! Headers of mclip with right checksums, of which one field at a time is wrong.

use crate::common::{LIMITS, Vector, header_bytes, vectors};
use decoder_core::mclip::{Clip, CodecId, EntropyId, Header, HeaderFields, PREFIX_BYTES, Prefix};
use decoder_core::{Error, Field, Limits};

/// A vector of this codec with this entropy stage, the smallest.
fn vector(codec: CodecId, entropy: Option<EntropyId>) -> Vec<u8> {
    let matching = vectors("SHA256SUMS.mclip").into_iter().filter(|Vector { bytes, .. }| {
        let header = Header::parse(bytes, LIMITS).unwrap();
        header.codec().id() == codec && entropy.is_none_or(|entropy| header.entropy() == entropy)
    });
    matching.min_by_key(|vector| vector.bytes.len()).unwrap().bytes
}

/// The clip with other fields; its checksum is right.
fn rebuilt<'b>(bytes: &'b [u8], change: impl FnOnce(&mut HeaderFields<'b>)) -> Vec<u8> {
    let mut fields = *Header::parse(bytes, LIMITS).unwrap().fields();
    change(&mut fields);
    let mut clip = Vec::new();
    fields.emit(&mut clip);
    clip.extend(&bytes[header_bytes(bytes)..]);
    clip
}

fn error<'b>(bytes: &'b [u8], change: impl FnOnce(&mut HeaderFields<'b>)) -> Error {
    let changed = rebuilt(bytes, change);
    let error = Header::parse(&changed, LIMITS).unwrap_err();
    assert_eq!(Clip::parse(&changed, LIMITS).unwrap_err(), error);
    error
}

/// An error of the opening, which has one place for all its numbers.
fn malformed(field: Field, found: u32, low: u32, high: u32) -> Error {
    Error::Malformed { field, at: PREFIX_BYTES, found, low, high }
}

#[test]
fn a_header_written_again_is_the_same() {
    for Vector { name, bytes, .. } in vectors("SHA256SUMS.mclip") {
        assert_eq!(rebuilt(&bytes, |_| {}), bytes, "{name}");
    }
}

#[test]
fn a_prefix_is_refused_where_it_is_wrong() {
    let sound = vector(CodecId::Dpcm, None);
    let start = header_bytes(&sound);
    for len in 0..PREFIX_BYTES {
        let truncated = Error::Truncated { field: Field::Header, at: 0, needed: PREFIX_BYTES, found: len };
        assert_eq!(Prefix::read(&sound[..len]), Err(truncated));
    }
    let changed = |at: usize, byte: u8| {
        let mut bytes = sound.clone();
        bytes[at] = byte;
        Header::parse(&bytes, LIMITS).unwrap_err()
    };
    let magic = u32::from_le_bytes(*b"MCLP");
    for at in 0..4 {
        let found = magic ^ (u32::from(b"MCLP"[at]) << (8 * at));
        assert_eq!(
            changed(at, 0),
            Error::Malformed { field: Field::Magic, at: 0, found, low: magic, high: magic }
        );
    }
    assert_eq!(changed(4, 77), Error::Unsupported { field: Field::Version, found: 77 });
    assert_eq!(changed(7, 1), Error::Malformed { field: Field::Version, at: 6, found: 256, low: 0, high: 0 });
    let needed = start + (1 << 24);
    let truncated = Error::Truncated { field: Field::Header, at: 0, needed, found: sound.len() };
    assert_eq!(changed(11, 1), truncated);
    let error = changed(start - 1, sound[start - 1] ^ 0x80);
    let Error::Checksum { field: Field::Header, at: 0, found, expected } = error else { panic!("{error}") };
    assert_eq!(found ^ expected, 0x8000_0000);
    assert!(matches!(changed(PREFIX_BYTES, 0xff), Error::Checksum { field: Field::Header, at: 0, .. }));
}

#[test]
fn numbers_are_refused_outside_their_ranges() {
    let bytes = vector(CodecId::Dpcm, None);
    let opening = *Header::parse(&bytes, LIMITS).unwrap().fields();
    assert_eq!(error(&bytes, |o| o.rate_numerator = 0), malformed(Field::Rate, 0, 1, u32::MAX));
    assert_eq!(error(&bytes, |o| o.rate_denominator = 0), malformed(Field::Rate, 0, 1, u32::MAX));
    let most = i32::MAX as u32;
    assert_eq!(error(&bytes, |o| o.frames = 0), malformed(Field::Frames, 0, 1, most));
    assert_eq!(error(&bytes, |o| o.frames = most + 1), malformed(Field::Frames, most + 1, 1, most));
    assert_eq!(error(&bytes, |o| o.channels = 0), malformed(Field::Channels, 0, 1, 65535));
    let limit = |field, found, limit| Error::Limit { field, found, limit };
    assert_eq!(error(&bytes, |o| o.frames = most), limit(Field::Frames, most, LIMITS.frames));
    assert_eq!(
        error(&bytes, |o| o.channels = LIMITS.channels + 1),
        limit(Field::Channels, u32::from(LIMITS.channels) + 1, LIMITS.channels.into())
    );
    let just = Limits { channels: opening.channels, frames: opening.frames };
    assert!(Header::parse(&bytes, just).is_ok());
    assert_eq!(
        Header::parse(&bytes, Limits { frames: opening.frames - 1, ..just }).unwrap_err(),
        limit(Field::Frames, opening.frames, opening.frames - 1)
    );
    let unsupported = |field| Error::Unsupported { field, found: 99 };
    assert_eq!(error(&bytes, |o| o.codec = 99), unsupported(Field::Codec));
    assert_eq!(error(&bytes, |o| o.entropy = 99), unsupported(Field::Entropy));
    assert_eq!(
        error(&bytes, |o| o.cycles = &[1, 2, 3, 4]),
        Error::Encoding { field: Field::Header, at: PREFIX_BYTES }
    );
    assert!(Header::parse(&rebuilt(&bytes, |o| o.cycles = &[1, 2, 3, 4, 5]), LIMITS).is_ok());
    // A channel more than there are, and one fewer.
    assert!(Header::parse(&rebuilt(&bytes, |o| o.channels += 1), LIMITS).is_err());
    assert!(opening.channels == 1 || Header::parse(&rebuilt(&bytes, |o| o.channels -= 1), LIMITS).is_err());
}

/// A delay is the codec's: none of today's has one.
#[test]
fn a_delay_that_is_not_the_codecs_is_refused() {
    for codec in CodecId::ALL {
        let bytes = vector(codec, None);
        assert_eq!(error(&bytes, |o| o.delay = 1), malformed(Field::Delay, 1, 0, 0));
    }
}

#[test]
fn the_memory_that_a_header_names_is_at_least_what_is_needed() {
    for Vector { name, bytes, .. } in vectors("SHA256SUMS.mclip") {
        let needed = Header::parse(&bytes, LIMITS).unwrap().needs().bytes() as u32;
        assert_eq!(
            error(&bytes, |o| o.ram = needed - 1),
            malformed(Field::Ram, needed - 1, needed, u32::MAX)
        );
        assert!(Header::parse(&rebuilt(&bytes, |o| o.ram = needed), LIMITS).is_ok(), "{name}");
        assert!(Header::parse(&rebuilt(&bytes, |o| o.ram = u32::MAX), LIMITS).is_ok(), "{name}");
    }
}

#[test]
fn rates_are_rounded_to_hundredths() {
    let bytes = vector(CodecId::Dpcm, None);
    for (numerator, denominator, expected) in [
        (120, 1, 12000),
        (30_000, 1001, 2997),
        (1, 200, 1),
        (1, 201, 0),
        (655, 1, 65500),
        (65_534, 100, 65534),
        (131_069, 200, 65535),
        (656, 1, 65535),
        (u32::MAX, 1, 65535),
        (1, u32::MAX, 0),
    ] {
        let changed = rebuilt(&bytes, |o| (o.rate_numerator, o.rate_denominator) = (numerator, denominator));
        let header = Header::parse(&changed, LIMITS).unwrap();
        assert_eq!(header.rate_centihertz(), expected, "{numerator}/{denominator}");
    }
}

#[test]
fn parameters_that_are_none_of_the_codecs_are_refused() {
    let none = Error::Encoding { field: Field::Parameters, at: PREFIX_BYTES };
    for codec in CodecId::ALL {
        let bytes = vector(codec, None);
        let own = Header::parse(&bytes, LIMITS).unwrap().fields().parameters;
        // A byte more than its own, more than any codec has, and none where it has some.
        let longer = [own, &[0]].concat();
        let wrong = [&longer[..], &[0; 1025], &[]].into_iter().filter(|&wrong| wrong != own);
        for parameters in wrong {
            assert_eq!(error(&bytes, |o| o.parameters = parameters), none, "{codec:?}, {parameters:?}");
        }
    }
    let bytes = vector(CodecId::Dpcm, None);
    assert_eq!(error(&bytes, |o| o.parameters = &[3]), malformed(Field::Parameters, 3, 0, 2));
}

#[test]
fn what_adapts_is_read_as_it_is_written_and_in_its_ranges() {
    for Vector { name, bytes, .. } in vectors("SHA256SUMS.mclip") {
        let header = Header::parse(&bytes, LIMITS).unwrap();
        let mut written = Vec::new();
        header.codec().emit(&mut written);
        assert_eq!(written, header.fields().parameters, "{name}");
    }
    let bytes = vector(CodecId::Adpcm, None);
    // Sixteen multipliers, the lowest and the highest step, window and period.
    let with = |low: u8, high: u8, window: u8, period: u8| {
        let multipliers = [1, 0x80, 3, 4, 5, 6, 7, 127, 8, 9, 10, 11, 12, 13, 14, 255];
        let parameters = [&multipliers[..], &[low, high, window, period]].concat();
        let changed = rebuilt(&bytes, |o| (o.parameters, o.ram) = (&parameters, u32::MAX));
        let header = Header::parse(&changed, LIMITS)?;
        let mut written = Vec::new();
        header.codec().emit(&mut written);
        assert_eq!(written, parameters);
        assert_eq!(header.needs().words > 0, (1..=6).contains(&window));
        Ok(())
    };
    assert_eq!(with(0, 199, 0, 0), Ok(()));
    assert_eq!(with(199, 199, 6, 14), Ok(()));
    assert_eq!(with(5, 9, 1, 0), Ok(()));
    assert_eq!(with(0, 200, 0, 0), Err(malformed(Field::Parameters, 200, 0, 199)));
    assert_eq!(with(9, 8, 0, 0), Err(malformed(Field::Parameters, 8, 9, 199)));
    assert_eq!(with(0, 199, 7, 0), Err(malformed(Field::Parameters, 7, 0, 6)));
    assert_eq!(with(0, 199, 6, 15), Err(malformed(Field::Parameters, 15, 0, 14)));
    // A sliding window is gone through at most eight words a frame.
    for (window, least) in [(15, 1), (16, 1), (17, 2), (32, 2), (33, 3), (64, 3), (65, 4), (120, 4)] {
        assert_eq!(with(0, 199, window, least), Ok(()));
        let below = u32::from(least) - 1;
        assert_eq!(
            with(0, 199, window, least - 1),
            Err(malformed(Field::Parameters, below, least.into(), 14))
        );
    }
    assert_eq!(with(0, 199, 0, 1), Err(malformed(Field::Parameters, 1, 0, 0)));
}

#[test]
fn tables_that_are_none_of_the_stages_are_refused() {
    let none = Error::Encoding { field: Field::CodeTables, at: PREFIX_BYTES };
    for codec in CodecId::ALL {
        let bytes = vector(codec, None);
        let fixed = |tables| error(&bytes, move |o| (o.entropy, o.tables) = (0, tables));
        assert_eq!(fixed(&[1]), none);
        let huffman = |tables| error(&bytes, move |o| (o.entropy, o.tables) = (1, tables));
        assert_eq!(huffman(&[]), none);
        assert_eq!(huffman(&[0, 0, 0]), none);
        let adaptive = |tables| error(&bytes, move |o| (o.entropy, o.tables, o.ram) = (2, tables, u32::MAX));
        assert_eq!(adaptive(&[]), none);
        assert_eq!(adaptive(&[4, 4]), none);
        assert_eq!(adaptive(&[0]), malformed(Field::CodeTables, 0, 1, 8));
        assert_eq!(adaptive(&[9]), malformed(Field::CodeTables, 9, 1, 8));
    }
    // A set of tables that is cut is found when it is built.
    let bytes = vector(CodecId::Dpcm, Some(EntropyId::Huffman));
    let tables = Header::parse(&bytes, LIMITS).unwrap().fields().tables.to_vec();
    let decoder = |tables: &[u8]| {
        let changed = rebuilt(&bytes, |o| o.tables = tables);
        let clip = Clip::parse(&changed, LIMITS).unwrap();
        let mut lent = crate::common::Heap::new(clip.header().needs());
        clip.decoder(lent.memory()).map(|_| ())
    };
    assert_eq!(decoder(&tables), Ok(()));
    assert_eq!(decoder(&tables[..tables.len() - 1]), Err(none));
    let longer = [tables.as_slice(), &[9]].concat();
    let (own, found) = (tables.len() as u32, longer.len() as u32);
    assert_eq!(decoder(&longer), Err(malformed(Field::CodeTables, found, own, own)));
}
