//! `validation page`: the page of a report again, without computing anything.

use std::path::PathBuf;
use std::process::ExitCode;

use files::{announce, refuse_input};

use crate::render::files::write_file;
use crate::render::html;
use crate::render::results::read_report;
use crate::render::sections::{chapter_about, section_lead};

/// Arguments of `validation page`.
#[derive(clap::Args)]
pub struct PageArgs {
    /// Folder of a report, with results.json and figures/
    report: PathBuf,
}

/// Writes `index.html` from the numbers and figures of a report.
///
/// # Errors
/// If the report cannot be read or the page cannot be written.
pub fn page(args: &PageArgs) -> miette::Result<ExitCode> {
    refuse_input(&args.report.join("index.html"), [args.report.join("results.json")])?;
    let (facts, chapters) = read_report(&args.report, chapter_about, section_lead)?;
    write_file(&args.report, "index.html", html::page(&facts, &chapters).as_bytes())?;
    announce!("{}", args.report.join("index.html").display());
    Ok(ExitCode::SUCCESS)
}
