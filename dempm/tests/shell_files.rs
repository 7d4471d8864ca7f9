//! Completions and manual pages, as shells and `man` take them.

use std::process::Command;

use assert_cmd::cargo::cargo_bin_cmd;

#[test]
fn a_shell_completes_commands_and_each_has_a_page() {
    let folder = tempfile::tempdir().unwrap();
    cargo_bin_cmd!("dempm").arg("shell-files").arg(folder.path()).assert().success();
    let at = |name: &str| folder.path().join(name);
    for file in ["completions/zsh/_dempm", "completions/fish/dempm.fish", "man/man1/dempm.1"] {
        assert!(at(file).exists(), "{file}");
    }
    let page = std::fs::read_to_string(at("man/man1/dempm-plot.1")).unwrap();
    assert!(page.starts_with(".ie") && page.contains(".TH dempm-plot 1"), "{page}");
    assert!(!at("man/man1/dempm-shell-files.1").exists(), "a hidden command");

    let complete = |words: &str, current: usize| {
        let script = format!(
            "source {}; COMP_WORDS=({words}); COMP_CWORD={current}; \
             _dempm dempm \"${{COMP_WORDS[{current}]}}\" x; echo \"${{COMPREPLY[@]}}\"",
            at("completions/bash/dempm").display()
        );
        let output = Command::new("bash").args(["-c", &script]).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    assert_eq!(complete("dempm pl", 1), "plot\n");
    assert_eq!(complete("dempm plot --comp", 2), "--compare\n");
}
