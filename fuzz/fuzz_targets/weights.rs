//! Weights files (safetensors).
#![no_main]

use libfuzzer_sys::fuzz_target;
use surrogate::simulator::Simulator;

fuzz_target!(|bytes: &[u8]| {
    dempm_fuzz::with_file(bytes, "m.safetensors", |path| {
        let _ = Simulator::load(path);
    });
});
