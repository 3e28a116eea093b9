//! MATLAB files of versions 5 and 7.3.
#![no_main]

use lambdak::recording::mat::read_mat;
use lambdak_fuzz::{file, memory};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = read_mat(&file("input.mat", data), &memory());
});
