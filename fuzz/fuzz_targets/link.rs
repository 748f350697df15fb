//! libFuzzer's harness of the target `link`.
#![no_main]

use bunraku_fuzz::link;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    link::check(bytes);
});
