//! libFuzzer's harness of the target `amc`.
#![no_main]

use bunraku_fuzz::amc;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    amc::check(bytes);
});
