//! `validation report`: sections, one after the other, into a page, tables, figures and numbers.

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use dempm::device::Device;
use files::{INTERRUPTED, interrupt_flag, write_atomically};
use miette::{IntoDiagnostic, WrapErr, bail};

use crate::block::{Block, Figure, Table};
use crate::computed::{Computed, Made};
use crate::context::{Context, Suite, models_in};
use crate::html;
use crate::machine::processor;
use crate::progress::Progress;
use crate::results::{facts, results};
use crate::section::Section;
use crate::sections;
use crate::work::{Interrupted, Work};

/// Arguments of `validation report`.
#[derive(clap::Args)]
pub struct ReportArgs {
    /// Folder of trajectories (*.h5) in train/, valid/ and test/, as the paper's scenes make them
    #[arg(long)]
    data: Option<PathBuf>,
    /// Folder of models: *.safetensors, or folders of trainings [default: models, if it is there]
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
    /// Where to compute: auto, cpu, cuda or cuda:N [default: cpu for quick, auto for full]
    #[arg(long)]
    device: Option<Device>,
    /// Compute only sections whose titles contain one of these; others stay as they were
    #[arg(long, value_delimiter = ',', value_name = "PART")]
    only: Vec<String>,
    /// What a reader has to know of this report, for its beginning
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
}

/// The fact that stands at the beginning of the page.
pub const NOTE: &str = "note";

/// A chapter as far as it has been computed.
pub struct Written {
    pub title: &'static str,
    pub sections: Vec<WrittenSection>,
}

/// A section as far as it has been computed.
pub struct WrittenSection {
    pub title: &'static str,
    /// Name in addresses and files.
    pub slug: String,
    /// What it came to; none if it is not computed yet.
    pub computed: Option<Computed>,
}

impl WrittenSection {
    pub fn blocks(&self) -> &[Block] {
        self.computed.as_ref().map_or(&[], |computed| &computed.blocks)
    }
}

/// Writes the report, computing what is missing.
///
/// # Errors
/// If folders cannot be read or written. What cannot be computed is said in the report.
pub fn report(args: &ReportArgs) -> miette::Result<ExitCode> {
    let interrupted = interrupt_flag()?;
    let chapters = sections::all();
    let titles: Vec<&str> =
        chapters.iter().flat_map(|c| &c.sections).map(|section| section.title()).collect();
    for part in &args.only {
        if !titles.iter().any(|title| is_named(title, part)) {
            bail!(help = titles.join("\n"), "--only: no section has `{part}` in its title");
        }
    }
    let mut context = context(args, interrupted)?;
    let wanted = |section: &dyn Section| {
        let named = args.only.iter().any(|part| is_named(section.title(), part));
        section.always() || args.only.is_empty() || named
    };
    let mut written = Vec::new();
    let mut absent = Vec::new();
    // What is to be computed, and its place in the report.
    let mut planned: Vec<(&dyn Section, [usize; 2])> = Vec::new();
    for chapter in &chapters {
        let mut sections = Vec::new();
        for section in &chapter.sections {
            let slug = slug(section.title());
            // Until it is computed anew, a section stays as it was.
            let computed = Computed::kept(&context, &slug);
            if wanted(&**section) {
                planned.push((&**section, [written.len(), sections.len()]));
            } else if computed.is_some() {
                context.rests_on(&computed);
            } else {
                // Neither asked for nor there: no part of this report, which names it.
                absent.push(section.title());
                continue;
            }
            sections.push(WrittenSection { title: section.title(), slug, computed });
        }
        written.push(Written { title: chapter.title, sections });
    }
    // They look at what the others came to.
    planned.sort_by_key(|(section, _)| section.always());
    let total = planned.iter().map(|(section, _)| section.estimate(&context)).sum();
    context.progress = Progress::new(total);
    for section in written.iter().flat_map(|chapter| &chapter.sections) {
        put_files(&args.output, section)?;
    }
    write(args, &context, &written, &absent)?;

    for (section, [chapter, place]) in planned {
        let Some(computed) = compute(section, &mut context) else {
            context.progress.finish();
            eprintln!("interrupted; the same command continues");
            return Ok(ExitCode::from(INTERRUPTED));
        };
        let entry = &mut written[chapter].sections[place];
        computed.keep(&context, &entry.slug)?;
        entry.computed = Some(computed);
        context.rests_on(&entry.computed);
        put_files(&args.output, entry)?;
        write(args, &context, &written, &absent)?;
    }
    context.progress.finish();
    println!("{}", args.output.join("index.html").display());
    let all = written.iter().flat_map(|chapter| &chapter.sections);
    let failed = all.filter(|section| section.computed.as_ref().is_some_and(|c| c.failed));
    let failed: Vec<&str> = failed.map(|section| section.title).collect();
    if !failed.is_empty() {
        bail!("sections that could not be computed: {}", failed.join(", "));
    }
    Ok(ExitCode::SUCCESS)
}

/// Computes a section; none if the user interrupts.
/// Whether a part of `--only` names a section.
fn is_named(title: &str, part: &str) -> bool {
    title.to_lowercase().contains(&part.to_lowercase())
}

fn compute(section: &dyn Section, context: &mut Context) -> Option<Computed> {
    let began = Instant::now();
    let (blocks, failed) = match section.run(context) {
        Ok(blocks) => (blocks, false),
        Err(error) if error.downcast_ref::<Interrupted>().is_some() => return None,
        Err(error) => {
            context.progress.say(&format!("{}: {error:?}", section.title()));
            (vec![failure(&error)], true)
        }
    };
    Some(Computed {
        made: Made::now(context),
        seconds: began.elapsed().as_secs_f64(),
        failed,
        blocks,
        runs: context.work.take_used(),
    })
}

fn failure(error: &miette::Report) -> Block {
    let chain: Vec<String> = error.chain().map(ToString::to_string).collect();
    Block::missing("This section", chain.join(": "), "")
}

fn context(args: &ReportArgs, interrupted: Arc<AtomicBool>) -> miette::Result<Context> {
    for folder in [&args.data, &args.models].into_iter().flatten() {
        if !folder.is_dir() {
            bail!("{}: there is no such folder", folder.display());
        }
    }
    let device = args.device.unwrap_or(match args.suite {
        Suite::Quick => Device::Cpu,
        Suite::Full => Device::Auto,
    });
    let gpu = device.open().into_diagnostic()?;
    let threads = rayon::current_num_threads();
    let (name, device_name, rate) = match &gpu {
        Some(gpu) => {
            let number = if let Device::Cuda(Some(number)) = device { number } else { 0 };
            // The rate of an H200: an estimate is all that is wanted of it.
            (format!("cuda:{number}"), gpu.name().to_owned(), 2e10)
        }
        None => {
            let rate = dempm::check::disc_steps_per_second().into_diagnostic()?;
            ("cpu".to_owned(), format!("{}, {threads} threads", processor()), rate)
        }
    };
    let work = args.work.clone().unwrap_or_else(|| {
        let mut name = args.output.clone().into_os_string();
        name.push("-work");
        name.into()
    });
    let shipped = Some(PathBuf::from("models")).filter(|folder| folder.is_dir());
    let models = args.models.clone().or(shipped);
    let program = std::env::current_exe().into_diagnostic()?;
    let absolute = |folder: &PathBuf| fs::canonicalize(folder).into_diagnostic();
    Ok(Context {
        suite: args.suite,
        device: name,
        device_name,
        work: Work::open(&work, program, gpu.is_some(), interrupted)?,
        progress: Progress::hidden(),
        data: args.data.as_ref().map(absolute).transpose()?,
        models: models.as_ref().map(absolute).transpose()?.map_or(vec![], |f| models_in(&f)),
        runs: Vec::new(),
        rate,
        hashes: RefCell::default(),
        sweeps: HashMap::new(),
    })
}

/// Writes the page and the numbers. `absent` names the sections that are not part of it.
fn write(
    args: &ReportArgs,
    context: &Context,
    written: &[Written],
    absent: &[&str],
) -> miette::Result<()> {
    let mut facts = facts(context, written, absent);
    facts.extend(args.note.iter().map(|note| (NOTE, note.clone())));
    let results = results(&facts, context, written);
    put(&args.output, "results.json", &serde_json::to_vec(&results).into_diagnostic()?)?;
    put(&args.output, "index.html", html::page(&facts, written).as_bytes())
}

/// Writes the tables and figures of a section, whose names begin with the section's.
fn put_files(output: &Path, section: &WrittenSection) -> miette::Result<()> {
    let mut names = HashSet::new();
    for (name, bytes) in files(section) {
        if !names.insert(name.clone()) {
            bail!("two tables or figures want the name {name}");
        }
        put(output, &name, &bytes)?;
    }
    Ok(())
}

fn put(output: &Path, name: &str, bytes: &[u8]) -> miette::Result<()> {
    let path = output.join(name);
    write_atomically(&path, |temporary| fs::write(temporary, bytes))
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write {}", path.display()))
}

/// The files of a section: tables as CSV, figures.
fn files(section: &WrittenSection) -> Vec<(String, Vec<u8>)> {
    let table = |table: &Table| (table_file(section, &table.title), table.csv().into_bytes());
    let of_block = |block: &Block| match block {
        Block::Table(found) => Some(table(found)),
        Block::Map(map) => Some(table(&map.table())),
        Block::Figure(figure) => {
            Some((figure_file(section, figure), figure.picture.bytes().to_vec()))
        }
        _ => None,
    };
    section.blocks().iter().filter_map(of_block).collect()
}

/// Name of the CSV file of a table or map.
pub fn table_file(section: &WrittenSection, title: &str) -> String {
    format!("tables/{}--{}.csv", section.slug, slug(title))
}

/// Name of the file of a figure.
pub fn figure_file(section: &WrittenSection, figure: &Figure) -> String {
    format!("figures/{}--{}.{}", section.slug, slug(&figure.title), figure.picture.suffix())
}

/// Letters and digits of a title, the rest as hyphens.
pub fn slug(title: &str) -> String {
    let plain = title.to_lowercase().replace(|c: char| !c.is_ascii_alphanumeric(), "-");
    let words: Vec<&str> = plain.split('-').filter(|word| !word.is_empty()).collect();
    words.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_become_names_of_files() {
        assert_eq!(slug("Speed against accuracy: mu(I), 1 m"), "speed-against-accuracy-mu-i-1-m");
    }

    #[test]
    fn no_two_sections_have_the_same_name() {
        let chapters = sections::all();
        let titles: Vec<String> =
            chapters.iter().flat_map(|c| &c.sections).map(|s| slug(s.title())).collect();
        let distinct: HashSet<&String> = titles.iter().collect();
        assert_eq!(distinct.len(), titles.len(), "{titles:?}");
    }
}
