//! `dempm calibrate`: grains that behave like a measured material.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use files::{
    FileLock, INTERRUPTED, Interrupt, WriteError, announce, note, read_sealed, refuse_input, seal,
    write_atomically, write_text,
};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, bail, miette};

use super::device::report as report_device;
use super::outputs::default_output;
use super::progress::bars;
use crate::calibrate::{
    Experiment, Laboratory, Progress, Study, Targets, calibrated_toml, law, members_csv, page,
    summary_toml,
};
use crate::device::Device;

/// Laws that can be fitted to the calibrated grains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LawKind {
    /// The mu(I) law of scenes.
    MuI,
}

/// Find grains that behave like a measured material, with their uncertainty.
#[derive(Args, Clone, Debug)]
pub struct CalibrateArgs {
    /// Targets (TOML): what is measured, what is free and what stays
    pub targets: PathBuf,
    /// Folder of the results [default: the file's name without .toml, in the current directory]
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Also fit this law to packings of the calibrated grains
    #[arg(long, value_enum)]
    pub law: Option<LawKind>,
    /// auto, cpu, cuda or cuda:N; columns are simulated on the CPU
    #[arg(long, default_value = "auto")]
    pub device: Device,
    /// Continue an interrupted calibration, or begin it
    #[arg(long, conflicts_with = "overwrite")]
    pub resume: bool,
    /// Start again although the folder has results
    #[arg(long)]
    pub overwrite: bool,
}

/// State of a calibration, in its folder.
const STATE: &str = "calibration.ckpt";
/// Results, in its folder.
const GRAINS: &str = "calibrated.toml";
const SUMMARY: &str = "posterior.toml";
const LOG: &str = "members.csv";
const PAGE: &str = "calibration.html";
/// Pressure (Pa) of the law if no target has one.
const USUAL_PRESSURE: f64 = 10.0e3;
/// Packings that the law is fitted to.
const LAW_PACKINGS: usize = 8;

/// Calibrates grains.
///
/// # Errors
/// If a file cannot be read or written, the targets are wrong, or grains cannot be simulated.
pub fn calibrate(args: &CalibrateArgs, verbose: bool) -> miette::Result<ExitCode> {
    let interrupt = Interrupt::install()?;
    let targets = Targets::load(&args.targets)?;
    let folder = args.output.clone().unwrap_or_else(|| default_output(&args.targets, ""));
    let file = |name: &str| folder.join(name);
    for name in [STATE, GRAINS, SUMMARY, LOG, PAGE] {
        refuse_input(&file(name), &targets.inputs)?;
    }
    if targets.free.is_empty() && args.law.is_none() {
        bail!(
            help = "add [free.KEY] and [[target]], or fit a law to these grains with --law",
            "{}: no parameter is free",
            args.targets.display()
        );
    }
    let _lock = FileLock::take(&file(STATE))?;
    let study = start(args, &targets, &folder)?;
    let selection = args.device.select().into_diagnostic()?;
    report_device(&selection, verbose);
    let gpu = selection.first();
    let laboratory = |title: String, tests: usize| Laboratory {
        gpu: gpu.clone(),
        progress: Shown { bar: bar(&bars(), title, tests), interrupt: &interrupt },
    };
    let mut found = None;
    if !targets.free.is_empty() {
        let Some(study) = seek(study, &targets, &folder, laboratory)? else {
            return Ok(ExitCode::from(INTERRUPTED));
        };
        let posterior = study.posterior(&targets)?;
        found = Some((study, posterior));
    }
    let posterior = found.as_ref().map(|(_, posterior)| posterior);
    let mut fitted = None;
    if let Some(LawKind::MuI) = args.law {
        let laboratory = laboratory("mu(I)".into(), law::tests(LAW_PACKINGS));
        let rve =
            targets.rve_with(posterior.map_or(&[][..], |posterior| posterior.mean.as_slice()));
        fitted = law::fit(&laboratory, &rve, pressure(&targets), LAW_PACKINGS, targets.seed)?;
        laboratory.progress.bar.finish_and_clear();
        let Some(law) = &fitted else {
            note!("interrupted in the fit of the law; continue with --resume");
            return Ok(ExitCode::from(INTERRUPTED));
        };
        let p = &law.parameters;
        announce!(
            "mu(I): static friction {:.3}, dynamic {:.3}, I_0 {:.3}, K {:.2e} Pa, G {:.2e} Pa",
            p.static_friction,
            p.dynamic_friction,
            p.inertial_number,
            p.bulk_modulus,
            p.shear_modulus
        );
    }
    let _guard = interrupt.guard();
    let grains = calibrated_toml(&targets, posterior, fitted.as_ref()).into_diagnostic()?;
    write_text(&file(GRAINS), &grains)?;
    announce!("wrote {}", file(GRAINS).display());
    let Some((study, posterior)) = &found else { return Ok(ExitCode::SUCCESS) };
    let summary = summary_toml(&targets, study, posterior).into_diagnostic()?;
    write_text(&file(SUMMARY), &summary)?;
    let html = page(&targets, study, posterior, fitted.as_ref()).into_diagnostic()?;
    write_text(&file(PAGE), &html)?;
    for ((free, mean), sd) in targets.free.iter().zip(&posterior.mean).zip(&posterior.sd) {
        announce!("{:<22} {} ± {}", free.key, plot::number(*mean), plot::number(*sd));
    }
    for line in posterior.identifiability(&targets) {
        announce!("{line}");
    }
    announce!("wrote {}", file(PAGE).display());
    Ok(ExitCode::SUCCESS)
}

/// Simulates all rounds, each in a laboratory of its own with a title and a number of tests; `None` if interrupted.
fn seek<'a>(
    mut study: Study,
    targets: &Targets,
    folder: &Path,
    laboratory: impl Fn(String, usize) -> Laboratory<Shown<'a>>,
) -> miette::Result<Option<Study>> {
    let rounds = targets.method.rounds + 1;
    while !study.is_done(targets) {
        let round = study.rounds.len() + 1;
        let laboratory = laboratory(format!("round {round} of {rounds}"), targets.tests());
        let done = study.advance(targets, &laboratory)?;
        laboratory.progress.bar.finish_and_clear();
        if !done {
            note!("interrupted in round {round}; continue with --resume");
            return Ok(None);
        }
        save(&study, &folder.join(STATE))?;
        write_text(&folder.join(LOG), &members_csv(targets, &study))?;
        report(targets, &study, round, rounds);
    }
    Ok(Some(study))
}

/// A new study, or the one that the folder has.
fn start(args: &CalibrateArgs, targets: &Targets, folder: &Path) -> miette::Result<Study> {
    let state = folder.join(STATE);
    let there = [&state, &folder.join(GRAINS)].into_iter().find(|file| file.exists()).cloned();
    if let Some(there) = there.filter(|_| !args.overwrite && !args.resume) {
        bail!(
            help = "continue with --resume, or start again with --overwrite",
            "{} exists",
            there.display()
        );
    }
    if args.overwrite || !state.exists() {
        return Ok(Study::new(targets));
    }
    let study: Study = postcard::from_bytes(&read_sealed(&state)?)
        .map_err(|_| miette!("{}: not written by this version of dempm", state.display()))?;
    if !study.is_of(targets) {
        bail!(
            help = "undo the change, or start again with --overwrite",
            "the targets or their tables have changed since the calibration began"
        );
    }
    Ok(study)
}

fn save(study: &Study, path: &Path) -> miette::Result<()> {
    let bytes = seal(postcard::to_stdvec(study).into_diagnostic()?);
    write_atomically(path, |temporary| {
        std::fs::write(temporary, &bytes).map_err(WriteError::at(path, "write it"))
    })?;
    Ok(())
}

/// The pressure of the first target that has one.
fn pressure(targets: &Targets) -> f64 {
    let of = targets.observations.iter().find_map(|observation| match observation.experiment {
        Experiment::Biaxial { pressure }
        | Experiment::SimpleShear { pressure }
        | Experiment::CriticalFriction { pressure }
        | Experiment::BulkDensity { pressure } => Some(pressure),
        Experiment::Oedometer | Experiment::RunOut(_) | Experiment::Repose(_) => None,
    });
    of.unwrap_or(USUAL_PRESSURE)
}

/// The best set of parameters so far.
fn report(targets: &Targets, study: &Study, round: usize, rounds: usize) {
    let Some(best) = study.best() else { return };
    let values: Vec<String> = targets
        .free
        .iter()
        .zip(targets.values(&best.u))
        .map(|(free, value)| format!("{} {}", free.key, plot::number(value)))
        .collect();
    announce!(
        "round {round} of {rounds}: best misfit {:.2} standard deviations, {}",
        best.misfit,
        values.join(", ")
    );
}

fn bar(bars: &MultiProgress, title: String, tests: usize) -> ProgressBar {
    let style = ProgressStyle::with_template(
        "{prefix}  {bar:24} {percent:>3} %  {pos}/{len} tests  {eta} left",
    )
    .expect("the template is valid");
    let bar = ProgressBar::new(tests as u64).with_style(style).with_prefix(title);
    bars.add(bar)
}

struct Shown<'a> {
    bar: ProgressBar,
    interrupt: &'a Interrupt,
}

impl Progress for Shown<'_> {
    fn tested(&self, tests: usize) {
        self.bar.inc(tests as u64);
    }

    fn stop(&self) -> bool {
        self.interrupt.requested()
    }
}
