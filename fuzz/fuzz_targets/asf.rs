//! libFuzzer's harness of the target `asf`.
#![no_main]

use bunraku_fuzz::asf;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    asf::check(bytes);
});
