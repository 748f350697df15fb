//! libFuzzer's harness of the target `qmd`.
#![no_main]

use bunraku_fuzz::qmd;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    qmd::check(bytes);
});
