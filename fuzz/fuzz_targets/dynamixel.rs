//! libFuzzer's harness of the target `dynamixel`.
#![no_main]

use bunraku_fuzz::dynamixel;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    dynamixel::check(bytes);
});
