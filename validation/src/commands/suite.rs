//! Commands of the suite as hidden subcommands of `validation`. The report runs each in a process of
//! its own: a failing run cannot end the report, its messages can be quoted, and a report never
//! mixes versions of programs.

use std::process::ExitCode;

use clap::Subcommand;

/// A command of the suite with its own arguments.
#[derive(Subcommand)]
pub enum SuiteCommand {
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

impl SuiteCommand {
    /// Runs the command; with `verbose` it names the device.
    ///
    /// # Errors
    /// As the command.
    pub fn run(&self, verbose: bool) -> miette::Result<ExitCode> {
        match self {
            Self::Run(args) => dempm::commands::run::run(args, verbose),
            Self::Element(args) => {
                dempm::commands::element::element(args).map(|()| ExitCode::SUCCESS)
            }
            Self::Rollout(args) => surrogate::commands::rollout(args, verbose),
        }
    }
}
