//! Completions of shells and manual pages of a program.

use std::path::PathBuf;

use clap::Command;
use clap_complete::Shell;
use files::{announce, write_text};

/// Arguments of the hidden command `shell-files`.
#[derive(clap::Args)]
pub struct ShellFilesArgs {
    /// Folder to write `completions` and `man` into
    folder: PathBuf,
}

/// Shells with completions.
const SHELLS: [Shell; 3] = [Shell::Bash, Shell::Zsh, Shell::Fish];

/// Writes the completions of a program, and a manual page for it and each of its commands.
///
/// # Errors
/// If a file cannot be written.
pub fn shell_files(args: &ShellFilesArgs, program: Command) -> miette::Result<()> {
    let name = program.get_name().to_owned();
    for shell in SHELLS {
        let mut text = Vec::new();
        clap_complete::generate(shell, &mut program.clone(), &name, &mut text);
        let file = match shell {
            Shell::Zsh => format!("_{name}"),
            Shell::Fish => format!("{name}.fish"),
            _ => name.clone(),
        };
        let folder = args.folder.join("completions").join(shell.to_string());
        write_text(&folder.join(file), &String::from_utf8_lossy(&text))?;
    }
    let mut program = program.disable_help_subcommand(true);
    program.build();
    let commands = program.get_subcommands().filter(|command| !command.is_hide_set());
    for command in std::iter::once(&program).chain(commands) {
        let title = command.get_display_name().unwrap_or(&name).to_owned();
        let mut text = Vec::new();
        clap_mangen::Man::new(command.clone())
            .title(&title)
            .render(&mut text)
            .expect("a vector takes all that is written to it");
        let page = args.folder.join("man/man1").join(format!("{title}.1"));
        write_text(&page, &String::from_utf8_lossy(&text))?;
    }
    announce!("{}", args.folder.display());
    Ok(())
}
