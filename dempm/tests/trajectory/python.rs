//! Readers that do not know our code: h5py, numpy and VTK, where Python has them.

use std::path::Path;
use std::process::Command;

/// Runs a script with the arguments `args`, or says why it is skipped: the interpreter (`PYTHON`,
/// else python3) cannot import `modules`.
pub fn check(modules: &str, script: &str, args: &[&Path]) {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has_modules = Command::new(&python)
        .args(["-c", &format!("import {modules}")])
        .output()
        .is_ok_and(|output| output.status.success());
    if !has_modules {
        eprintln!("skipped: {python} cannot import {modules} (PYTHON names another interpreter)");
        return;
    }
    let output = Command::new(&python).args(["-c", script]).args(args).output().unwrap();
    assert!(
        output.status.success(),
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}
