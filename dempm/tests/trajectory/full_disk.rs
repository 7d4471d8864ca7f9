//! A disk without room, played by a limit on the size of files: every write beyond it fails.

use std::path::Path;
use std::process::{Command, Output};

use assert_cmd::cargo::cargo_bin;
use dempm::trajectory::Trajectory;

/// Eleven frames, so that the disk can fill up at any of them.
const SCENE: &str = "duration = 0.05\nframe_interval = 0.005\n[domain]\nsize = [4.0, 2.0]\n\
                     cell = 0.0625\n[[column]]\nsize = [1.0, 1.0]\n[material]\nkind = \"mu-i\"\n";

/// Runs `dempm` where no file may be longer than so many blocks of 512 bytes.
fn dempm(folder: &Path, blocks: usize, words: &str) -> Output {
    let program = cargo_bin("dempm");
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec {} {words}", program.display());
    Command::new("sh").args(["-c", &script]).current_dir(folder).output().unwrap()
}

/// Fails as it should: with an exit code, the file and the reason.
fn fails(output: &Output, file: &str) {
    let error = String::from_utf8_lossy(&output.stderr);
    // A crash has no exit code.
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.contains(file) && error.contains("File too large"), "{error}");
    assert!(!error.contains("ZipWriter"), "{error}");
}

/// Wherever in the file it happens: what is there stays readable, and room is all that it takes to
/// go on.
#[test]
fn a_run_says_so_and_goes_on_once_there_is_room() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.h5");
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let run = "run scene.toml -o a.h5 --device cpu --checkpoint-interval 0";
    assert!(dempm(folder.path(), 1 << 20, run).status.success());
    let blocks = std::fs::metadata(&path).unwrap().len() as usize / 512;
    let whole = Trajectory::open(&path).unwrap();
    let mut kept = Vec::new();
    for limit in (30..blocks).step_by(blocks / 16) {
        fails(&dempm(folder.path(), limit, &format!("{run} --overwrite")), "a.h5");
        let files = std::fs::read_dir(folder.path()).unwrap();
        let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
        assert!(!names.into_iter().any(|name| name.ends_with("tmp")));
        kept.push(Trajectory::open(&path).unwrap().frames());
    }
    assert!(kept.is_sorted() && kept.last() > Some(&5), "{kept:?}");
    let output = dempm(folder.path(), 1 << 20, &format!("{run} --resume"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let resumed = Trajectory::open(&path).unwrap();
    let frames = |t: &Trajectory| -> Vec<_> {
        (0..t.frames()).map(|index| t.frame(index).unwrap()).collect()
    };
    assert_eq!(frames(&resumed), frames(&whole));
}

#[test]
fn an_export_says_so() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let run = dempm(folder.path(), 1 << 20, "run scene.toml -o a.h5 --device cpu");
    assert!(run.status.success());
    for (format, file) in
        [("npz", "x"), ("gns", "x/train.npz"), ("lagrangebench", "x/train.h5"), ("vtk", "x_frames")]
    {
        let output = dempm(folder.path(), 8, &format!("export a.h5 --to {format} -o x"));
        fails(&output, file);
    }
}
