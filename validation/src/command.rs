//! The commands of the suite that the report runs, each in a process of its own: a failing run
//! cannot take the report with it, and what a program says can be quoted. They are hidden
//! subcommands of `validation`, so a report never mixes versions of programs.

use std::process::ExitCode;

use clap::Subcommand;

/// A command of the suite, with its own arguments.
#[derive(Subcommand)]
pub enum Suite {
    /// `dempm run`
    #[command(hide = true)]
    Run(dempm::commands::run::RunArgs),
    /// `dempm element`, which `validation/yade/compare.py` calls
    #[command(hide = true)]
    Element(dempm::commands::element::ElementArgs),
    /// `surrogate rollout`
    #[command(hide = true)]
    Rollout(surrogate::commands::RolloutArgs),
}

impl Suite {
    /// Does what the command does.
    ///
    /// # Errors
    /// As the command.
    pub fn run(&self) -> miette::Result<ExitCode> {
        match self {
            Self::Run(args) => dempm::commands::run::run(args, false),
            Self::Element(args) => {
                dempm::commands::element::element(args).map(|()| ExitCode::SUCCESS)
            }
            Self::Rollout(args) => surrogate::commands::rollout(args),
        }
    }
}
