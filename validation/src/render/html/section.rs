//! Sections: a folded box with its lead, then its blocks.

use std::fmt::Write as _;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::table::{write_map, write_table};
use super::text::{escape, inline};
use crate::render::block::{Block, Missing};
use crate::render::figure::{Figure, Picture};
use crate::render::report::ReportSection;

/// CSS class of a section in the table of contents, and a remark.
pub(super) fn standing(section: &ReportSection) -> (&'static str, &'static str) {
    let missing = section.blocks().iter().any(|block| matches!(block, Block::Missing(_)));
    match &section.computed {
        None => ("not-yet", " <small>not computed yet</small>"),
        Some(computed) if computed.failed => ("failed", " <small>failed</small>"),
        Some(_) if missing => ("partial", " <small>incomplete</small>"),
        Some(_) => ("done", ""),
    }
}

/// Writes a section; with `device`, where it was computed.
pub(super) fn write_section(html: &mut String, section: &ReportSection, device: bool) {
    let _ = writeln!(
        html,
        "<section id=\"{}\"><details><summary><h3>{}</h3><p>{}</p></summary>",
        section.slug,
        escape(&section.title),
        inline(&section.lead)
    );
    if let Some(computed) = section.computed.as_ref().filter(|_| device) {
        let _ = writeln!(html, "<p><small>On {}.</small></p>", escape(&computed.made.device));
    }
    if section.computed.is_none() {
        *html += "<p class=\"missing\">Not computed yet.</p>\n";
    }
    for block in section.blocks() {
        write_block(html, section, block);
    }
    *html += "</details></section>\n";
}

fn write_block(html: &mut String, section: &ReportSection, block: &Block) {
    // Writing to a string cannot fail, here and below.
    match block {
        Block::Headline(text) | Block::Lead { answer: text, .. } => {
            let _ = writeln!(html, "<p class=\"headline\">{}</p>", inline(text));
        }
        Block::Heading(text) => {
            let _ = writeln!(html, "<h4>{}</h4>", inline(text));
        }
        Block::Text(text) => {
            let _ = writeln!(html, "<p>{}</p>", inline(text));
        }
        Block::List(lines) | Block::Findings(lines) => write_list(html, lines),
        Block::Quote(text) => {
            let _ = writeln!(html, "<pre>{}</pre>", escape(text));
        }
        Block::Table(table) => write_table(html, section, table),
        Block::Figure(figure) => write_figure(html, section, figure),
        Block::Map(map) => write_map(html, section, map),
        Block::Missing(Missing { what, why, remedy }) => {
            let [what, why, remedy] = [what, why, remedy].map(|text| inline(text));
            let _ = writeln!(
                html,
                "<p class=\"missing\"><strong>{what}</strong> is not shown: {why} {remedy}</p>"
            );
        }
    }
}

fn write_list(html: &mut String, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    *html += "<ul>";
    for line in lines {
        let _ = write!(html, "<li>{}</li>", inline(line));
    }
    *html += "</ul>\n";
}

/// Writes a figure with its caption and a link to its file.
pub(super) fn write_figure(html: &mut String, section: &ReportSection, figure: &Figure) {
    let title = escape(&figure.title);
    let animated = if matches!(figure.picture, Picture::Gif(_)) { " animation" } else { "" };
    let _ = write!(html, "<figure class=\"picture{animated}\">");
    match &figure.picture {
        Picture::Svg(text) => *html += &plot::inlined(text, &title),
        picture => {
            let _ = write!(
                html,
                "<img alt=\"{title}\" src=\"data:image/{};base64,{}\">",
                picture.suffix(),
                STANDARD.encode(picture.bytes())
            );
        }
    }
    let _ = writeln!(
        html,
        "\n<figcaption><strong>{}.</strong> {} <a href=\"{}\">Full size</a></figcaption></figure>",
        inline(&figure.title),
        inline(&figure.caption),
        section.figure_file(figure)
    );
}
