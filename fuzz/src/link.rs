//! Bytes on the link to a host.

use crate::Random;
use firmware::clock::Speed;
use firmware::link::frame::{Deframer, OVERHEAD, wire_len, write};
use firmware::link::message::{ANSWER_BYTES, Answer, REQUEST_BYTES, Refusal, Request, Response, VERSION};
use firmware::link::session::Session;
use firmware::link::wire::{Raw, decode_all};
use firmware::machine::Command;
use firmware::store::StoreError;

/// Sessions of all requests, as frames; and as messages, each behind its length.
pub fn seeds() -> Vec<Vec<u8>> {
    let play = Command::Play { clip: 3, repeats: true };
    let requests = [
        Request::Hello { version: VERSION, session: 7 },
        Request::Command(play),
        Request::Command(Command::Speed(Speed::FASTEST)),
        Request::Telemetry { millis: 100 },
        Request::Hold { millis: 500 },
        Request::Clip { index: 2 },
        Request::Begin { clip: 3, name: "walk", bytes: 300, crc: 0x1234_5678 },
        Request::Data { offset: 0, bytes: &[0, 1, 2, 0, 0xff, 3] },
        Request::Commit,
        Request::Remove { clip: 3 },
        Request::Stream { bytes: 600 },
        Request::Header { offset: 512, bytes: &[9; 88] },
        Request::Packet { bytes: &[5; 300] },
        Request::Command(Command::Seek { frame: 77 }),
        Request::Abandon,
        Request::Alive,
    ];
    let frames =
        |requests: &[Request<'_>]| (0..).zip(requests).flat_map(|(n, request)| frame(n, request)).collect();
    let message = |request: &Request<'_>| {
        let bytes = frame(0, request);
        let mut deframer = Deframer::<{ REQUEST_BYTES + OVERHEAD }>::new();
        let read = deframer.feed(&mut bytes.as_slice()).and_then(Result::ok);
        let message = read.map_or(&[][..], |frame| frame.message);
        [&[message.len().min(255) as u8], message].concat()
    };
    let short = requests.iter().filter(|request| !matches!(request, Request::Packet { .. }));
    vec![frames(&requests), frames(&requests[..6]), short.flat_map(message).collect()]
}

fn frame(number: u16, request: &Request<'_>) -> Vec<u8> {
    let mut buffer = [0; wire_len(REQUEST_BYTES)];
    write(number, request, &mut buffer).unwrap_or_else(|| panic!("{request:?} is too long")).to_vec()
}

/// Gives a session the bytes as a stream however it is cut; and the messages that they are, with right checksums.
///
/// # Panics
/// Where chunks change what is asked, an answer is none, or a request that was understood is another one when written again.
pub fn check(bytes: &[u8]) -> bool {
    let mut random = Random::of(bytes);
    let whole = serve(&[bytes]);
    let longest = 1 << random.below(9);
    assert_eq!(whole, serve(&random.chunks(bytes, longest)), "in chunks of up to {longest}");

    let mut stream = frame(0, &Request::Hello { version: VERSION, session: 1 });
    let (mut rest, mut number) = (bytes, 1u16);
    while let Some((&len, after)) = rest.split_first() {
        let (message, after) = after.split_at(usize::from(len).min(after.len()));
        rest = after;
        let mut buffer = [0; wire_len(256)];
        let written = write(number, &Raw(message), &mut buffer).unwrap_or_else(|| panic!("255 bytes fit"));
        stream.extend(&*written);
        number = number.wrapping_add([0, 1, 1, 1, 2, 0x8000][random.below(6)]);
    }
    let sealed = serve(&[&stream]);
    !whole.0.is_empty() || sealed.0.len() > 1
}

/// What a session asks for and answers.
fn serve(chunks: &[&[u8]]) -> (Vec<String>, Vec<String>) {
    let (mut session, mut reply) = (Session::new(), Deframer::<{ ANSWER_BYTES + OVERHEAD }>::new());
    let (mut asked, mut answers) = (Vec::new(), Vec::new());
    for mut chunk in chunks.iter().copied() {
        while !chunk.is_empty() {
            let before = chunk.len();
            session.serve(&mut chunk, 0, |request| {
                again(request);
                asked.push(format!("{request:?}"));
                match request {
                    Request::Command(_) => Response::Done,
                    Request::Begin { .. } => Response::Upload { next: 0 },
                    _ => Response::Refused(Refusal::Store(StoreError::Busy)),
                }
            });
            assert!(chunk.len() < before, "bytes are taken");
            let outgoing = session.outgoing().to_vec();
            session.sent(outgoing.len());
            let mut outgoing = outgoing.as_slice();
            while let Some(frame) = reply.feed(&mut outgoing) {
                let frame = frame.unwrap_or_else(|error| panic!("{error}"));
                let answer: Answer = decode_all(frame.message).unwrap_or_else(|| panic!("an answer is none"));
                answers.push(format!("{} {answer:?}", frame.sequence));
            }
        }
    }
    assert!(asked.len() <= answers.len(), "each request is answered");
    (asked, answers)
}

/// A request that was understood is the same when it is written again.
fn again(request: &Request<'_>) {
    let bytes = frame(9, request);
    let mut deframer = Deframer::<{ REQUEST_BYTES + OVERHEAD }>::new();
    let mut rest = bytes.as_slice();
    let read = deframer.feed(&mut rest).map(|frame| frame.unwrap_or_else(|error| panic!("{error}")));
    let message = read.map_or(&[][..], |frame| frame.message);
    let read: Request<'_> = decode_all(message).unwrap_or_else(|| panic!("a request is none"));
    assert_eq!(&read, request);
}
