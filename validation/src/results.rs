//! `results.json`: what the report was made with, what it says, and the runs behind it.

use files::utc_now;
use serde_json::{Value, json};

use crate::block::{Block, Table};
use crate::computed::Made;
use crate::context::Context;
use crate::report::{Written, WrittenSection, figure_file, table_file};

/// What the whole report was made with, as (what, value). Sections may have been made at different
/// times and places; `absent` are those that have not been.
pub fn facts(
    context: &Context,
    written: &[Written],
    absent: &[&str],
) -> Vec<(&'static str, String)> {
    let computed = || {
        let sections = written.iter().flat_map(|chapter| &chapter.sections);
        sections.filter_map(|section| section.computed.as_ref())
    };
    let distinct = |value: fn(&Made) -> &String| {
        let mut values: Vec<&str> = Vec::new();
        for made in computed().map(|computed| &computed.made) {
            if !values.contains(&value(made).as_str()) {
                values.push(value(made));
            }
        }
        values.join("\n")
    };
    let runs = &context.runs;
    let other = runs.iter().filter(|run| run.build != context.work.build()).count();
    let load = runs.iter().filter_map(|run| run.load).fold(0.0, f64::max);
    let mut facts = vec![
        ("written", utc_now()),
        ("commands", distinct(|made| &made.command)),
        ("suite", format!("{:?}", context.suite).to_lowercase()),
        ("version", distinct(|made| &made.version)),
        ("device", distinct(|made| &made.device)),
        ("runs used", runs.len().to_string()),
        ("of them by another build", other.to_string()),
        ("largest load per core at the end of a run", crate::table::number(load)),
    ];
    if !absent.is_empty() {
        facts.push(("sections not computed", absent.join("\n")));
    }
    facts
}

/// All numbers of the report, and the runs behind them.
pub fn results(facts: &[(&str, String)], context: &Context, written: &[Written]) -> Value {
    let facts: serde_json::Map<String, Value> =
        facts.iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
    let section = |section: &WrittenSection| {
        let blocks: Vec<Value> =
            section.blocks().iter().map(|block| block_as_json(section, block)).collect();
        let Some(computed) = &section.computed else {
            return json!({ "title": section.title, "state": "notyet" });
        };
        let state = if computed.failed { "failed" } else { "done" };
        json!({ "title": section.title, "state": state, "seconds": computed.seconds,
                "made": computed.made, "blocks": blocks })
    };
    let chapters: Vec<Value> = written
        .iter()
        .map(|chapter| {
            let sections: Vec<Value> = chapter.sections.iter().map(section).collect();
            json!({ "title": chapter.title, "sections": sections })
        })
        .collect();
    json!({ "report": facts, "chapters": chapters, "runs": context.runs })
}

fn block_as_json(section: &WrittenSection, block: &Block) -> Value {
    let table = |kind: &str, table: &Table| {
        let file = table_file(section, &table.title);
        json!({ "kind": kind, "title": table.title, "columns": table.columns, "rows": table.rows,
                "note": table.note, "file": file })
    };
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
