//! The files of a report: the page, the numbers, tables and figures.

use std::collections::HashSet;
use std::fs;
use std::path::Path;

use files::write_atomically;
use miette::{IntoDiagnostic, WrapErr, bail};

use crate::render::block::Block;
use crate::render::report::ReportSection;
use crate::render::table::Table;

/// Writes a file of a report, whole or not at all.
///
/// # Errors
/// If it cannot be written.
pub fn write_file(folder: &Path, name: &str, bytes: &[u8]) -> miette::Result<()> {
    let path = folder.join(name);
    write_atomically(&path, |temporary| fs::write(temporary, bytes))
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write {}", path.display()))
}

/// Writes the tables and figures of a section.
///
/// # Errors
/// If two of them have the same name, or a file cannot be written.
pub fn write_section_files(folder: &Path, section: &ReportSection) -> miette::Result<()> {
    let mut names = HashSet::new();
    for (name, bytes) in files(section) {
        if !names.insert(name.clone()) {
            bail!("section `{}`: two tables or figures have the name {name}", section.title);
        }
        write_file(folder, &name, &bytes)?;
    }
    Ok(())
}

fn files(section: &ReportSection) -> Vec<(String, Vec<u8>)> {
    let table = |table: &Table| (section.table_file(&table.title), table.csv().into_bytes());
    let of_block = |block: &Block| match block {
        Block::Table(found) => Some(table(found)),
        Block::Map(map) => Some(table(&map.table())),
        Block::Figure(figure) => {
            Some((section.figure_file(figure), figure.picture.bytes().to_vec()))
        }
        _ => None,
    };
    section.blocks().iter().filter_map(of_block).collect()
}
