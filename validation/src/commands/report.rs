//! `validation report`: computes sections one by one and writes the page, tables and figures.

use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use dempm::device::Device;
use files::{INTERRUPTED, Interrupt, announce, note, refuse_input};
use miette::{IntoDiagnostic, bail};

use crate::context::Context;
use crate::machine::processor;
use crate::models::models_in;
use crate::progress::Progress;
use crate::render::block::Block;
use crate::render::files::{write_file, write_section_files};
use crate::render::html;
use crate::render::report::{NOTE, ReportChapter, ReportSection};
use crate::render::results::{facts, read_report, results};
use crate::render::section::{Chapter, Section};
use crate::render::sections;
use crate::run_cache::{Interrupted, RunCache};
use crate::section_cache::{Computed, Made};
use crate::suite::Suite;
use crate::text::slug;
use dempm::check::Rates;

/// Arguments of `validation report`.
#[derive(clap::Args)]
pub struct ReportArgs {
    /// Folder of trajectories (*.h5) in train/, valid/ and test/, as `dempm dataset paper` makes them
    #[arg(long)]
    data: Option<PathBuf>,
    /// Folder of models: *.safetensors, or folders of trainings [default: models, if it exists]
    #[arg(long)]
    models: Option<PathBuf>,
    /// How much to compute
    #[arg(long, value_enum, default_value_t = Suite::Quick)]
    suite: Suite,
    /// Folder of the report
    #[arg(short, long, default_value = "report")]
    output: PathBuf,
    /// Folder of runs, which are reused [default: the output's name and "-work"]
    #[arg(long)]
    work: Option<PathBuf>,
    /// Device: auto, cpu, cuda or cuda:N [default: cpu for quick, auto for full]
    #[arg(long)]
    device: Option<Device>,
    /// Compute only sections whose titles contain one of these; the others stay as they are
    #[arg(long, value_delimiter = ',', value_name = "PART")]
    only: Vec<String>,
    /// A remark for the top of the page
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
}

/// A report on its way.
struct Report<'a> {
    args: &'a ReportArgs,
    context: Context,
    chapters: Vec<ReportChapter>,
    /// Titles of sections that are neither asked for nor kept.
    absent: Vec<&'static str>,
}

/// A section to be computed, and its chapter and place there.
type Planned<'s> = (&'s dyn Section, [usize; 2]);

/// Writes the report and computes what is missing.
///
/// # Errors
/// If folders cannot be read or written, or a section failed, which the page then says.
pub fn report(args: &ReportArgs) -> miette::Result<ExitCode> {
    let interrupt = Interrupt::install()?;
    let chapters = sections::all();
    check_only(&args.only, &chapters)?;
    let context = context(args, interrupt)?;
    adopt(&args.output, &context)?;
    let mut report = Report { args, context, chapters: Vec::new(), absent: Vec::new() };
    let planned = report.plan(&chapters);
    let total = planned.iter().map(|(section, _)| section.estimate(&report.context)).sum();
    report.context.progress = Progress::new(total);
    for section in report.chapters.iter().flat_map(|chapter| &chapter.sections) {
        write_section_files(&args.output, section)?;
    }
    report.write()?;
    for planned in planned {
        if !report.compute(planned)? {
            report.context.progress.finish();
            note!("interrupted; the same command continues");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        report.write()?;
    }
    report.context.progress.finish();
    announce!("{}", args.output.join("index.html").display());
    let all = report.chapters.iter().flat_map(|chapter| &chapter.sections);
    let failed = all.filter(|section| section.computed.as_ref().is_some_and(|c| c.failed));
    let failed: Vec<&str> = failed.map(|section| section.title.as_str()).collect();
    if !failed.is_empty() {
        bail!("sections that failed: {}", failed.join(", "));
    }
    Ok(ExitCode::SUCCESS)
}

/// Refuses parts of `--only` that name no section.
fn check_only(only: &[String], chapters: &[Chapter]) -> miette::Result<()> {
    let titles: Vec<&str> =
        chapters.iter().flat_map(|c| &c.sections).map(|section| section.title()).collect();
    for part in only {
        if !titles.iter().any(|title| is_named(title, part)) {
            bail!(help = titles.join("\n"), "--only: no title of a section contains `{part}`");
        }
    }
    Ok(())
}

/// Whether a part of `--only` names a section.
fn is_named(title: &str, part: &str) -> bool {
    title.to_lowercase().contains(&part.to_lowercase())
}

/// Keeps the sections of an earlier report in the output folder that the work directory lacks: part of a
/// report can be computed again where its runs are not.
fn adopt(output: &Path, context: &Context) -> miette::Result<()> {
    if !output.join("results.json").is_file() {
        return Ok(());
    }
    let (facts, chapters) = read_report(output, sections::chapter_about, sections::section_lead)?;
    if !facts.iter().any(|(name, value)| name == "suite" && value == context.suite.name()) {
        return Ok(());
    }
    for section in chapters.into_iter().flat_map(|chapter| chapter.sections) {
        if let Some(computed) = section.computed
            && Computed::kept(context, &section.slug).is_none()
        {
            computed.keep(context, &section.slug)?;
        }
    }
    Ok(())
}

impl Report<'_> {
    /// Takes what is kept into the report, and lists what is to be computed.
    fn plan<'s>(&mut self, chapters: &'s [Chapter]) -> Vec<Planned<'s>> {
        let only = &self.args.only;
        let wanted = |section: &dyn Section| {
            let named = only.iter().any(|part| is_named(section.title(), part));
            section.always() || only.is_empty() || named
        };
        let mut planned: Vec<Planned> = Vec::new();
        for chapter in chapters {
            let mut sections = Vec::new();
            for section in &chapter.sections {
                // Until it is computed again, a section stays as it was.
                let computed = Computed::kept(&self.context, &slug(section.title()));
                if wanted(&**section) {
                    planned.push((&**section, [self.chapters.len(), sections.len()]));
                } else if let Some(computed) = &computed {
                    self.context.add_runs(&computed.runs);
                } else {
                    self.absent.push(section.title());
                    continue;
                }
                sections.push(ReportSection::new(section.title(), section.lead(), computed));
            }
            let (title, about) = (chapter.title.to_owned(), chapter.about.to_owned());
            self.chapters.push(ReportChapter { title, about, sections });
        }
        // These summarise the others.
        planned.sort_by_key(|(section, _)| section.always());
        planned
    }

    /// Computes a section; false if the user interrupts.
    fn compute(&mut self, (section, [chapter, place]): Planned) -> miette::Result<bool> {
        let context = &mut self.context;
        let began = Instant::now();
        let (blocks, failed) = match section.run(context) {
            Ok(blocks) => (blocks, false),
            Err(error) if error.downcast_ref::<Interrupted>().is_some() => return Ok(false),
            Err(error) => {
                context.progress.say(&format!("{}: {error:?}", section.title()));
                (vec![failure(&error)], true)
            }
        };
        let computed = Computed {
            made: Made::now(context),
            seconds: began.elapsed().as_secs_f64(),
            failed,
            blocks,
            runs: context.cache.take_used(),
        };
        let entry = &mut self.chapters[chapter].sections[place];
        computed.keep(context, &entry.slug)?;
        context.add_runs(&computed.runs);
        entry.computed = Some(computed);
        write_section_files(&self.args.output, entry)?;
        Ok(true)
    }

    /// Writes the page and the numbers.
    fn write(&self) -> miette::Result<()> {
        let Self { args, context, chapters, absent } = self;
        let mut facts = facts(context, chapters, absent);
        facts.extend(args.note.iter().map(|note| (NOTE.to_owned(), note.clone())));
        let results = results(&facts, context, chapters);
        let results = serde_json::to_vec(&results).into_diagnostic()?;
        write_file(&args.output, "results.json", &results)?;
        write_file(&args.output, "index.html", html::page(&facts, chapters).as_bytes())
    }
}

fn failure(error: &miette::Report) -> Block {
    let chain: Vec<String> = error.chain().map(ToString::to_string).collect();
    Block::missing("This section", chain.join(": "), "")
}

fn context(args: &ReportArgs, interrupt: Interrupt) -> miette::Result<Context> {
    for folder in [&args.data, &args.models].into_iter().flatten() {
        if !folder.is_dir() {
            bail!("{}: there is no such folder", folder.display());
        }
    }
    let device = args.device.unwrap_or(args.suite.pick(Device::Cpu, Device::Auto));
    let gpu = device.open().into_diagnostic()?;
    let threads = rayon::current_num_threads();
    let (name, device_name) = match &gpu {
        Some(gpu) => {
            let number = if let Device::Cuda(Some(number)) = device { number } else { 0 };
            (format!("cuda:{number}"), gpu.name().to_owned())
        }
        None => ("cpu".to_owned(), format!("{}, {threads} threads", processor())),
    };
    let rates = Rates::measure(gpu.is_some()).into_diagnostic()?;
    let work = args.work.clone().unwrap_or_else(|| {
        let mut name = args.output.clone().into_os_string();
        name.push("-work");
        name.into()
    });
    let shipped = Some(PathBuf::from("models")).filter(|folder| folder.is_dir());
    let models = args.models.clone().or(shipped);
    for output in [&args.output, &work] {
        refuse_input(output, args.data.iter().chain(&models))?;
    }
    let program = std::env::current_exe().into_diagnostic()?;
    let absolute = |folder: &PathBuf| fs::canonicalize(folder).into_diagnostic();
    Ok(Context {
        suite: args.suite,
        device: name,
        device_name,
        cache: RunCache::open(&work, program, gpu.is_some(), interrupt)?,
        progress: Progress::hidden(),
        data: args.data.as_ref().map(absolute).transpose()?,
        models: models.as_ref().map(absolute).transpose()?.map_or(vec![], |f| models_in(&f)),
        runs: Vec::new(),
        rates,
        hashes: RefCell::default(),
    })
}
