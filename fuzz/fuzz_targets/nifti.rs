//! NIfTI images, compressed or not.
#![no_main]

use lambdak::recording::Image;
use lambdak_fuzz::memory;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = Image::read(data, &memory());
    let _ = Image::read_any_unit(data, &memory());
});
