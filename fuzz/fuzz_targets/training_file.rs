//! Training files.
#![no_main]

use libfuzzer_sys::fuzz_target;
use surrogate::train::TrainConfig;

fuzz_target!(|text: &str| {
    let _ = TrainConfig::parse(text, "fuzz.toml");
});
