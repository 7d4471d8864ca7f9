//! The first screen: the main results in a sentence each, an animation and a chart.

use std::fmt::Write as _;

use super::section::write_figure;
use super::text::{escape, inline};
use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::render::report::{ReportChapter, ReportSection};

/// Writes the leads of all sections and the first animation and chart of the cover.
pub(super) fn write_first_screen(html: &mut String, chapters: &[ReportChapter]) {
    let leads: Vec<String> = blocks(chapters)
        .filter_map(|(section, block)| match block {
            Block::Lead { question, answer } => Some(format!(
                "<div><dt><a href=\"#{}\">{}</a></dt><dd>{}</dd></div>",
                section.slug,
                escape(question),
                inline(answer)
            )),
            _ => None,
        })
        .collect();
    if !leads.is_empty() {
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(html, "<dl class=\"leads\">{}</dl>", leads.concat());
    }
    let cover: Vec<(&ReportSection, &Figure)> = blocks(chapters)
        .filter_map(|(section, block)| match block {
            Block::Figure(figure) if figure.cover => Some((section, figure)),
            _ => None,
        })
        .collect();
    let moves =
        |(_, figure): &&(&ReportSection, &Figure)| matches!(figure.picture, Picture::Gif(_));
    let animation = cover.iter().find(moves);
    let chart = cover.iter().find(|figure| !moves(figure));
    if animation.or(chart).is_none() {
        return;
    }
    *html += "<div class=\"cover\">\n";
    for (section, figure) in animation.into_iter().chain(chart) {
        write_figure(html, section, figure);
    }
    *html += "</div>\n";
}

/// Writes the headlines of all sections.
pub(super) fn write_headlines(html: &mut String, chapters: &[ReportChapter]) {
    let lines: Vec<String> = blocks(chapters)
        .filter_map(|(section, block)| match block {
            Block::Headline(text) => Some(format!(
                "<li><a href=\"#{}\">{}</a>: {}</li>",
                section.slug,
                escape(&section.title),
                inline(text)
            )),
            _ => None,
        })
        .collect();
    if !lines.is_empty() {
        let _ = writeln!(
            html,
            "<details class=\"headlines\"><summary>Main results of the sections</summary>\
             <ul>{}</ul></details>",
            lines.concat()
        );
    }
}

fn blocks(chapters: &[ReportChapter]) -> impl Iterator<Item = (&ReportSection, &Block)> {
    let sections = chapters.iter().flat_map(|chapter| &chapter.sections);
    sections.flat_map(|section| section.blocks().iter().map(move |block| (section, block)))
}
