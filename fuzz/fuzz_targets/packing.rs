//! Packings of element tests (CSV).
#![no_main]

use dem::RveParameters;
use dempm::element::read_packing;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    dempm_fuzz::with_file(bytes, "packing.csv", |path| {
        let _ = read_packing(path, &RveParameters::default());
    });
});
