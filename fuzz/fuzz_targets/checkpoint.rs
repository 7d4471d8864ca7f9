//! Checkpoints of runs, with and without the hash that belongs to them.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let sealed = files::seal(bytes.to_vec());
    for bytes in [bytes, &sealed] {
        dempm_fuzz::with_file(bytes, "t.h5.ckpt", |path| {
            let _ = dempm::run::checkpoint::read(path, "");
        });
    }
});
