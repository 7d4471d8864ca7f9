//! `results.json`: what the report was made with, what it shows, and the runs behind it.

use std::fs;
use std::path::Path;

use files::utc_now;
use miette::{IntoDiagnostic, WrapErr, miette};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::context::Context;
use crate::render::block::{Block, Missing};
use crate::render::figure::{Figure, Picture};
use crate::render::map::Map;
use crate::render::report::{Facts, NOTE, ReportChapter, ReportSection};
use crate::render::table::Table;
use crate::section_cache::{Computed, Made};
use crate::text::number;

/// Names of the facts, in the order in which the page has them.
const FACTS: [&str; 10] = [
    "written",
    "commands",
    "suite",
    "version",
    "device",
    "runs used",
    "of them by another build",
    "largest load per core at the end of a run",
    "sections not computed",
    NOTE,
];

/// What the report was made with. Sections may have been computed at different times and places;
/// `absent` are the titles of those that have not been.
pub fn facts(context: &Context, chapters: &[ReportChapter], absent: &[&str]) -> Facts {
    let distinct = |value: fn(&Made) -> &String| {
        let sections = chapters.iter().flat_map(|chapter| &chapter.sections);
        let mut values: Vec<&str> = Vec::new();
        for computed in sections.filter_map(|section| section.computed.as_ref()) {
            let value = value(&computed.made).as_str();
            if !values.contains(&value) {
                values.push(value);
            }
        }
        values.join("\n")
    };
    let runs = &context.runs;
    let other = runs.iter().filter(|run| run.build != context.cache.build()).count();
    let load = runs.iter().filter_map(|run| run.load).fold(0.0, f64::max);
    let values = [
        utc_now(),
        distinct(|made| &made.command),
        context.suite.name().to_owned(),
        distinct(|made| &made.version),
        distinct(|made| &made.device),
        runs.len().to_string(),
        other.to_string(),
        number(load),
        absent.join("\n"),
    ];
    let facts = FACTS.iter().map(|name| (*name).to_owned()).zip(values);
    facts.filter(|(name, value)| name != "sections not computed" || !value.is_empty()).collect()
}

/// The contents of `results.json`.
pub fn results(facts: &Facts, context: &Context, chapters: &[ReportChapter]) -> Value {
    let facts: serde_json::Map<String, Value> =
        facts.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
    let chapters: Vec<Value> = chapters
        .iter()
        .map(|chapter| {
            let sections: Vec<Value> = chapter.sections.iter().map(section_as_json).collect();
            json!({ "title": chapter.title, "sections": sections })
        })
        .collect();
    json!({ "report": facts, "chapters": chapters, "runs": context.runs })
}

fn section_as_json(section: &ReportSection) -> Value {
    let blocks: Vec<Value> =
        section.blocks().iter().map(|block| block_as_json(section, block)).collect();
    let Some(computed) = &section.computed else {
        return json!({ "title": section.title, "state": "notyet" });
    };
    let state = if computed.failed { "failed" } else { "done" };
    json!({ "title": section.title, "state": state, "seconds": computed.seconds,
            "made": computed.made, "blocks": blocks })
}

fn block_as_json(section: &ReportSection, block: &Block) -> Value {
    match block {
        Block::Headline(text) => json!({ "kind": "headline", "text": text }),
        Block::Lead { question, answer } => {
            json!({ "kind": "lead", "question": question, "text": answer })
        }
        Block::Heading(text) => json!({ "kind": "heading", "text": text }),
        Block::Text(text) => json!({ "kind": "text", "text": text }),
        Block::List(lines) => json!({ "kind": "list", "lines": lines }),
        Block::Findings(lines) => json!({ "kind": "findings", "lines": lines }),
        Block::Quote(text) => json!({ "kind": "quote", "text": text }),
        Block::Table(table) => json!({
            "kind": "table", "title": table.title, "columns": table.columns, "rows": table.rows,
            "note": table.note, "file": section.table_file(&table.title),
        }),
        Block::Map(map) => {
            let Table { title, columns, rows, note } = map.table();
            let file = section.table_file(&title);
            json!({ "kind": "map", "title": title, "columns": columns, "rows": rows, "note": note,
                    "file": file, "map": map })
        }
        Block::Figure(figure) => json!({
            "kind": "figure", "title": figure.title, "caption": figure.caption,
            "file": section.figure_file(figure), "cover": figure.cover,
        }),
        Block::Missing(missing) => json!({
            "kind": "missing", "what": missing.what, "why": missing.why,
            "remedy": missing.remedy,
        }),
    }
}

/// The facts and chapters of the report in a folder. The texts are found by titles: the introduction
/// of a chapter, the lead of a section.
///
/// # Errors
/// If `results.json` or a figure cannot be read.
pub fn read_report(
    folder: &Path,
    chapter_about: fn(&str) -> String,
    section_lead: fn(&str) -> String,
) -> miette::Result<(Facts, Vec<ReportChapter>)> {
    let path = folder.join("results.json");
    let failed = || format!("cannot read {}", path.display());
    let text = fs::read(&path).into_diagnostic().wrap_err_with(failed)?;
    let results: Value = serde_json::from_slice(&text).into_diagnostic().wrap_err_with(failed)?;
    let known = FACTS.iter().filter_map(|name| {
        Some(((*name).to_owned(), results["report"].get(name)?.as_str()?.to_owned()))
    });
    let chapter = |chapter: &Value| -> miette::Result<ReportChapter> {
        let title: String = field(chapter, "title")?;
        let sections = list(chapter, "sections")?.iter();
        let sections = sections.map(|section| read_section(folder, section, section_lead));
        let about = chapter_about(&title);
        Ok(ReportChapter { title, about, sections: sections.collect::<miette::Result<_>>()? })
    };
    let chapters = list(&results, "chapters")?.iter().map(chapter);
    let chapters = chapters.collect::<miette::Result<_>>().wrap_err_with(failed)?;
    Ok((known.collect(), chapters))
}

fn read_section(
    folder: &Path,
    section: &Value,
    lead: fn(&str) -> String,
) -> miette::Result<ReportSection> {
    let title: String = field(section, "title")?;
    let state: String = field(section, "state")?;
    let mut read = ReportSection::new(&title, &lead(&title), None);
    if state != "notyet" {
        let blocks = list(section, "blocks")?.iter().map(|block| read_block(folder, block));
        read.computed = Some(Computed {
            made: field(section, "made")?,
            seconds: field(section, "seconds")?,
            failed: state == "failed",
            blocks: blocks.collect::<miette::Result<_>>()?,
            runs: Vec::new(),
        });
    }
    Ok(read)
}

fn read_block(folder: &Path, block: &Value) -> miette::Result<Block> {
    let text = |name: &str| field::<String>(block, name);
    Ok(match text("kind")?.as_str() {
        "headline" => Block::Headline(text("text")?),
        "lead" => Block::Lead { question: text("question")?, answer: text("text")? },
        "heading" => Block::Heading(text("text")?),
        "text" => Block::Text(text("text")?),
        "list" => Block::List(field(block, "lines")?),
        "findings" => Block::Findings(field(block, "lines")?),
        "quote" => Block::Quote(text("text")?),
        "table" => Block::Table(field::<Table>(&json!({ "table": block }), "table")?),
        "map" => Block::Map(field::<Map>(block, "map")?),
        "figure" => Block::Figure(Figure {
            title: text("title")?,
            caption: text("caption")?,
            picture: read_picture(&folder.join(text("file")?))?,
            cover: field(block, "cover")?,
        }),
        "missing" => Block::Missing(Missing {
            what: text("what")?,
            why: text("why")?,
            remedy: text("remedy")?,
        }),
        kind => return Err(miette!("unknown kind of block: `{kind}`")),
    })
}

fn read_picture(path: &Path) -> miette::Result<Picture> {
    let failed = || format!("cannot read {}", path.display());
    let bytes = fs::read(path).into_diagnostic().wrap_err_with(failed)?;
    match path.extension().and_then(|suffix| suffix.to_str()) {
        Some("svg") => {
            let text = String::from_utf8(bytes).into_diagnostic().wrap_err_with(failed)?;
            Ok(Picture::Svg(text))
        }
        Some("gif") => Ok(Picture::Gif(bytes)),
        _ => Ok(Picture::Png(bytes)),
    }
}

fn list<'v>(value: &'v Value, name: &str) -> miette::Result<&'v Vec<Value>> {
    value[name].as_array().ok_or_else(|| miette!("`{name}` is no list"))
}

fn field<T: DeserializeOwned>(value: &Value, name: &str) -> miette::Result<T> {
    let found = value.get(name).ok_or_else(|| miette!("there is no `{name}`"))?;
    T::deserialize(found).into_diagnostic().wrap_err_with(|| format!("`{name}`"))
}
