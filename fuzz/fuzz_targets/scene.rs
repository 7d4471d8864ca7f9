//! Scene files.
#![no_main]

use dempm::scene::Scene;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Err(error) = Scene::parse(text, "fuzz.toml") {
        // Its report shows places of the text.
        let _ = format!("{:?}", miette::Report::new(error));
    }
});
