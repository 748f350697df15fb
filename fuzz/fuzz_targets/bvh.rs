//! libFuzzer's harness of the target `bvh`.
#![no_main]

use bunraku_fuzz::bvh;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    bvh::check(bytes);
});
