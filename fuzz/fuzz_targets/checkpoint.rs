//! Checkpoints of runs, behind their hash.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let sealed = files::seal(bytes.to_vec());
    for bytes in [bytes, &sealed] {
        dempm_fuzz::with_file(bytes, "t.h5.ckpt", |path| {
            let _ = dempm::checkpoint::read(path, "");
        });
    }
});
