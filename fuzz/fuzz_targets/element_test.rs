//! Files of element tests.
#![no_main]

use dempm::element::ElementTest;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    dempm_fuzz::with_file(bytes, "test.toml", |path| {
        let _ = ElementTest::load(path);
    });
});
