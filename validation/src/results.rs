//! `results.json`: what the report was made with, what it says, and the runs behind it.

use dempm::trajectory::{Trajectory, utc_now};
use serde_json::{Value, json};

use crate::block::{Block, Table};
use crate::context::Context;
use crate::report::{Written, WrittenSection, figure_file, table_file};
use crate::work::Run;

/// What the whole report was made with, as (what, value).
pub fn facts(context: &Context) -> Vec<(&'static str, String)> {
    let used = context.work.used();
    let other = used.iter().filter(|run| run.build != context.work.build()).count();
    let load = used.iter().filter_map(|run| run.load).fold(0.0, f64::max);
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

/// All numbers of the report, and the runs behind them.
pub fn results(facts: &[(&str, String)], context: &Context, written: &[Written]) -> Value {
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
    let runs: Vec<Value> = context.work.used().iter().map(run_as_json).collect();
    json!({ "report": facts, "chapters": chapters, "runs": runs })
}

/// A run with what its trajectory says about it.
fn run_as_json(run: &Run) -> Value {
    let mut value = json!(run);
    if let (Ok(trajectory), Some(entries)) = (Trajectory::open(&run.output), value.as_object_mut())
    {
        let header = trajectory.header();
        entries.insert("seed".into(), json!(header.seed));
        entries.insert("device".into(), json!(header.device));
        entries.insert("precision".into(), json!(header.precision));
        entries.insert("versions".into(), json!(header.versions));
        entries.insert("wall_time".into(), json!(trajectory.wall_time()));
    }
    value
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
