//! The loop that encoders run: choosing the nearest codes to what was decoded gives the same frames again.

use crate::common::{Heap, LIMITS, vectors};
use decoder_core::I16F16;
use decoder_core::codec::RunningCodec;
use decoder_core::mclip::{Choose, Clip, State};
use decoder_core::quantise::{Quantise, Step};

/// An encoder without a plan: every channel gets the code that is nearest to its value.
struct Nearest<'f> {
    frame: &'f [I16F16],
    codes: usize,
    /// Largest step.
    largest: i32,
    /// Whether a difference had no code: what was decoded wrapped, which no encoder asks for.
    wrapped: bool,
}

impl Choose for Nearest<'_> {
    fn entry(&mut self, channel: usize, shift: u32, bits: u32) -> i32 {
        self.codes += 1;
        let value = self.frame[channel].to_bits() >> shift;
        // A value that is shifted out of the word is another one.
        let sign = value >> (bits - 1);
        self.wrapped |= sign != 0 && sign != -1;
        value
    }

    fn code<Q: Quantise>(&mut self, channel: usize, predicted: i32, quantiser: &Q, state: &State) -> i32 {
        if state.bits() == 0 {
            return 0;
        }
        self.codes += 1;
        self.largest = self.largest.max(quantiser.size(state.step()));
        let difference = self.frame[channel].to_bits().wrapping_sub(predicted);
        let code = quantiser.nearest(difference, state.step(), state.bits());
        self.wrapped |= quantiser.difference(code, &mut Step::of(state.step()), state.bits()) != difference;
        code
    }
}

#[test]
fn the_nearest_codes_to_a_clip_are_the_clip() {
    let (mut all, mut exact, mut codes, mut largest) = (0, 0, 0, 0);
    for vector in vectors("SHA256SUMS.mclip").into_iter().step_by(if cfg!(miri) { 4 } else { 1 }) {
        let bytes = &vector.bytes;
        let clip = Clip::parse(bytes, LIMITS).unwrap();
        let needs = clip.header().needs();
        let (mut lent, mut again) = (Heap::new(needs), Heap::new(needs));
        let mut decoder = clip.decoder(lent.memory()).unwrap();
        let RunningCodec::Scalar(mut encoder) = clip.header().open(again.memory()).unwrap();
        let mut wrapped = false;
        for block in clip.blocks() {
            let block = block.unwrap().header;
            for frame in 0..block.frames {
                let pose = decoder.next_frame().unwrap().unwrap().to_vec();
                let mut nearest = Nearest { frame: &pose, codes: 0, largest: 0, wrapped };
                let found = encoder.choose(&mut nearest, block.entry && frame == 0);
                wrapped = nearest.wrapped;
                let number = block.first_frame + u32::from(frame);
                assert!(wrapped || found == pose, "{} frame {number}", vector.name);
                codes += nearest.codes;
                largest = largest.max(nearest.largest);
            }
        }
        all += 1;
        exact += usize::from(!wrapped);
    }
    println!("{exact} of {all} vectors do not wrap");
    if !cfg!(miri) {
        assert!(exact > 10 && exact < all, "{exact} of {all}");
        assert!(codes > 1000 && largest > 1 << 16, "{codes} {largest}");
    }
}
