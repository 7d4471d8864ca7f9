//! `validation report`: sections, one after the other, into a page, tables, figures and numbers.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use dempm::device::Device;
use dempm::trajectory::{utc_now, write_atomically};
use miette::{IntoDiagnostic, WrapErr, bail};
use serde_json::{Value, json};

use crate::block::{Block, Figure, Table};
use crate::context::{Context, Suite, models_in};
use crate::html;
use crate::progress::Progress;
use crate::sections;
use crate::work::{Interrupted, Work};

/// Arguments of `validation report`.
#[derive(clap::Args)]
pub struct ReportArgs {
    /// Folder of trajectories (*.h5) in train/, valid/ and test/, as the paper's scenes make them
    #[arg(long)]
    data: Option<PathBuf>,
    /// Folder of models: *.safetensors, or folders of trainings
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
    /// Only sections whose title contains this
    #[arg(long)]
    only: Option<String>,
}

/// Exit code after Ctrl-C, as shells use it.
const INTERRUPTED: u8 = 130;

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
    pub blocks: Vec<Block>,
    /// Wall time, s; near zero if everything was there.
    pub seconds: f64,
    pub state: State,
}

/// How a section stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    NotYet,
    Done,
    /// It could not be computed; its only block says why.
    Failed,
}

/// Writes the report, computing what is missing.
///
/// # Errors
/// If folders cannot be read or written. What cannot be computed is said in the report.
pub fn report(args: &ReportArgs) -> miette::Result<ExitCode> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))
        .into_diagnostic()
        .wrap_err("cannot handle Ctrl-C")?;
    let mut context = context(args, interrupted)?;
    let wanted = |title: &str| {
        let title = title.to_lowercase();
        args.only.as_ref().is_none_or(|part| title.contains(&part.to_lowercase()))
    };
    let chapters = sections::all();
    let mut written = Vec::new();
    for chapter in &chapters {
        let sections = chapter.sections.iter().filter(|section| wanted(section.title()));
        let sections = sections.map(|section| WrittenSection {
            title: section.title(),
            slug: slug(section.title()),
            blocks: Vec::new(),
            seconds: 0.0,
            state: State::NotYet,
        });
        written.push(Written { title: chapter.title, sections: sections.collect() });
    }
    let estimates = chapters.iter().flat_map(|chapter| &chapter.sections);
    let total = estimates.filter(|s| wanted(s.title())).map(|s| s.estimate(&context)).sum();
    context.progress = Progress::new(total);

    for (chapter, place) in chapters.iter().zip(0..) {
        let sections = chapter.sections.iter().filter(|section| wanted(section.title()));
        for (section, number) in sections.zip(0..) {
            let began = Instant::now();
            let (blocks, state) = match section.run(&mut context) {
                Ok(blocks) => (blocks, State::Done),
                Err(error) if error.downcast_ref::<Interrupted>().is_some() => {
                    context.progress.finish();
                    eprintln!("interrupted; the same command continues");
                    return Ok(ExitCode::from(INTERRUPTED));
                }
                Err(error) => (vec![failure(&error)], State::Failed),
            };
            let entry = &mut written[place].sections[number];
            entry.blocks = blocks;
            entry.state = state;
            entry.seconds = began.elapsed().as_secs_f64();
            write(&args.output, &context, &written)?;
        }
    }
    context.progress.finish();
    println!("{}", args.output.join("index.html").display());
    let failed = written.iter().flat_map(|c| &c.sections).filter(|s| s.state == State::Failed);
    let failed: Vec<&str> = failed.map(|section| section.title).collect();
    if !failed.is_empty() {
        bail!("sections that could not be computed: {}", failed.join(", "));
    }
    Ok(ExitCode::SUCCESS)
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
            let number = if let Device::Cuda(number) = device { number } else { 0 };
            // The rate of an H200: an estimate is all that is wanted of it.
            (format!("cuda:{number}"), format!("{}, {threads} threads", gpu.name()), 2e10)
        }
        None => {
            let rate = dempm::rate::disc_steps_per_second().into_diagnostic()?;
            ("cpu".to_owned(), format!("{}, {threads} threads", processor()), rate)
        }
    };
    let work = args.work.clone().unwrap_or_else(|| {
        let mut name = args.output.clone().into_os_string();
        name.push("-work");
        name.into()
    });
    let program = std::env::current_exe().into_diagnostic()?;
    let absolute = |folder: &PathBuf| fs::canonicalize(folder).into_diagnostic();
    Ok(Context {
        suite: args.suite,
        device: name,
        device_name,
        work: Work::open(&work, program, interrupted)?,
        progress: Progress::new(0.0),
        data: args.data.as_ref().map(absolute).transpose()?,
        models: args.models.as_ref().map(absolute).transpose()?.map_or(vec![], |f| models_in(&f)),
        rate,
    })
}

/// The processor's name as the system has it.
fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split_once(':')).map(|(_, name)| name.trim());
    name.unwrap_or("cpu").to_owned()
}

/// Writes the page, the tables, the figures and the numbers.
fn write(output: &Path, context: &Context, written: &[Written]) -> miette::Result<()> {
    let put = |name: String, bytes: &[u8]| {
        let path = output.join(name);
        write_atomically(&path, |temporary| fs::write(temporary, bytes))
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot write {}", path.display()))
    };
    let mut names = HashSet::new();
    for section in written.iter().flat_map(|chapter| &chapter.sections) {
        for (name, bytes) in files(section) {
            if !names.insert(name.clone()) {
                bail!("two tables or figures want the name {name}");
            }
            put(name, &bytes)?;
        }
    }
    let facts = facts(context);
    let results = results(&facts, context, written);
    put("results.json".into(), &serde_json::to_vec_pretty(&results).into_diagnostic()?)?;
    put("index.html".into(), html::page(&facts, written).as_bytes())
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
    section.blocks.iter().filter_map(of_block).collect()
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
fn slug(title: &str) -> String {
    let plain = title.to_lowercase().replace(|c: char| !c.is_ascii_alphanumeric(), "-");
    let words: Vec<&str> = plain.split('-').filter(|word| !word.is_empty()).collect();
    words.join("-")
}

/// What the whole report was made with, as (what, value).
fn facts(context: &Context) -> Vec<(&'static str, String)> {
    let used = context.work.used();
    let other = used.iter().filter(|run| run.build != context.work.build()).count();
    let loads = used.iter().map(|run| run.load).filter(|load| load.is_finite());
    let load = loads.fold(0.0, f64::max);
    let command: Vec<String> = std::env::args().collect();
    vec![
        ("written", utc_now()),
        ("command", command.join(" ")),
        ("suite", format!("{:?}", context.suite).to_lowercase()),
        ("version", format!("{} (build {})", env!("CARGO_PKG_VERSION"), context.work.build())),
        ("device", context.device_name.clone()),
        ("runs used", used.len().to_string()),
        ("of them by another build", other.to_string()),
        ("largest load per core at the end of a run", crate::table::number(load)),
    ]
}

fn results(facts: &[(&str, String)], context: &Context, written: &[Written]) -> Value {
    let facts: serde_json::Map<String, Value> =
        facts.iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
    let section = |section: &WrittenSection| {
        let blocks: Vec<Value> =
            section.blocks.iter().map(|block| block_as_json(section, block)).collect();
        let state = format!("{:?}", section.state).to_lowercase();
        json!({ "title": section.title, "state": state, "seconds": section.seconds, "blocks": blocks })
    };
    let chapters: Vec<Value> = written
        .iter()
        .map(|chapter| {
            let sections: Vec<Value> = chapter.sections.iter().map(section).collect();
            json!({ "title": chapter.title, "sections": sections })
        })
        .collect();
    json!({ "report": facts, "chapters": chapters, "runs": context.work.used() })
}

fn block_as_json(section: &WrittenSection, block: &Block) -> Value {
    let table = |kind: &str, table: &Table| {
        let file = table_file(section, &table.title);
        json!({ "kind": kind, "title": table.title, "columns": table.columns, "rows": table.rows,
                "note": table.note, "file": file })
    };
    match block {
        Block::Heading(text) => json!({ "kind": "heading", "text": text }),
        Block::Text(text) => json!({ "kind": "text", "text": text }),
        Block::List(lines) => json!({ "kind": "list", "lines": lines }),
        Block::Quote(text) => json!({ "kind": "quote", "text": text }),
        Block::Table(found) => table("table", found),
        Block::Map(map) => table("map", &map.table()),
        Block::Figure(figure) => json!({
            "kind": "figure", "title": figure.title, "caption": figure.caption,
            "file": figure_file(section, figure),
        }),
        Block::Missing(missing) => json!({
            "kind": "missing", "what": missing.what, "why": missing.why,
            "remedy": missing.remedy,
        }),
    }
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
