//! Packings of element tests (CSV), and a moment of such a test.
#![no_main]

use clap::Parser;
use dempm::element::{ElementArgs, element};
use libfuzzer_sys::fuzz_target;

#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    element: ElementArgs,
}

const TEST: &str = r#"
sampling = 1.0e-4
packing = "packing.csv"
[rve]
discs = 20
[[stage]]
kind = "isotropic"
pressure = 2.0e3
duration = 1.0e-4
"#;

fuzz_target!(|bytes: &[u8]| {
    dempm_fuzz::with_file(bytes, "packing.csv", |packing| {
        let [test, path] = ["test.toml", "path.csv"].map(|name| packing.with_file_name(name));
        std::fs::write(&test, TEST).expect("a temporary file");
        let words = ["element".as_ref(), test.as_os_str(), "-o".as_ref(), path.as_os_str()];
        let _ = element(&Arguments::parse_from(words).element);
    });
});
