//! libFuzzer's harness of the target `mclip`.
#![no_main]

use bunraku_fuzz::mclip;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    mclip::check(bytes);
});
