//! The page: one HTML file with everything in it, for screens of any size and for paper.

use std::collections::HashSet;
use std::fmt::Write as _;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::block::{Block, Figure, Map, Missing, Table};
use crate::figure::Picture;
use crate::report::{NOTE, Written, WrittenSection, figure_file, table_file};

const STYLE: &str = include_str!("style.css");
const WORDS: &str = include_str!("words.html");

/// A fact of more lines is folded.
const MOST_LINES: usize = 4;

/// The whole page. `facts` says what it was made with.
pub fn page(facts: &[(&str, String)], written: &[Written]) -> String {
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>DEMPM validation report</title>\n<style>\n{STYLE}{}</style>\n</head>\n<body>\n\
         <header><h1>DEMPM validation report</h1>\n",
        plot::dark_style()
    );
    html += "<p>Granular flow by a material point method with a packing of discs in every point (the \
             direct solver), by a continuum law, and by networks that have learnt from the solver: set \
             beside the paper (Zhao, Chen, Zhao 2025), charted in speed against accuracy, and pushed \
             until they fail. All numbers are measured; what could not be measured is named.</p>\n";
    for (_, note) in facts.iter().filter(|(name, _)| *name == NOTE) {
        let _ = writeln!(html, "<p class=\"headline\">{}</p>", inline(note));
    }
    write_short(&mut html, written);
    html += WORDS;
    html += "</header>\n<nav>";
    let chapters = || written.iter().filter(|chapter| !chapter.sections.is_empty());
    for chapter in chapters() {
        let _ = write!(html, "<div><h2>{}</h2><ul>", escape(chapter.title));
        for section in &chapter.sections {
            let (class, mark) = standing(section);
            let (slug, title) = (&section.slug, escape(section.title));
            let _ =
                write!(html, "<li class=\"{class}\"><a href=\"#{slug}\">{title}</a>{mark}</li>");
        }
        html += "</ul></div>";
    }
    html += "</nav>\n<main>\n";
    let devices: HashSet<&str> = chapters()
        .flat_map(|chapter| &chapter.sections)
        .filter_map(|section| Some(section.computed.as_ref()?.made.device.as_str()))
        .collect();
    for chapter in chapters() {
        let _ = writeln!(html, "<h2 class=\"chapter\">{}</h2>", escape(chapter.title));
        for section in &chapter.sections {
            write_section(&mut html, section, devices.len() > 1);
        }
    }
    write_facts(&mut html, facts);
    html += "</main>\n</body>\n</html>\n";
    html
}

/// The first screen: what the report is about, the figures that belong to it, and the headlines of
/// all sections.
fn write_short(html: &mut String, written: &[Written]) {
    let sections = || written.iter().flat_map(|chapter| &chapter.sections);
    let blocks = || sections().flat_map(|s| s.blocks().iter().map(move |block| (s, block)));
    let leads: Vec<String> = blocks()
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
    for (section, block) in blocks() {
        if let Block::Figure(figure) = block
            && figure.cover
        {
            write_figure(html, section, figure);
        }
    }
    let lines: Vec<String> = blocks()
        .filter_map(|(section, block)| match block {
            Block::Headline(text) => Some(format!(
                "<li><a href=\"#{}\">{}</a>: {}</li>",
                section.slug,
                escape(section.title),
                inline(text)
            )),
            _ => None,
        })
        .collect();
    if !lines.is_empty() {
        let _ =
            writeln!(html, "<h2>In short</h2>\n<ul class=\"headlines\">{}</ul>", lines.concat());
    }
}

/// What the page was made with.
fn write_facts(html: &mut String, facts: &[(&str, String)]) {
    *html += "<section id=\"facts\">\n<h3>Versions, devices, commands</h3>\n<dl class=\"facts\">";
    for (name, value) in facts {
        let (lines, mut value) = (value.lines().count(), escape(value));
        if lines > MOST_LINES {
            value = format!("<details><summary>{lines}</summary>{value}</details>");
        }
        let _ = write!(html, "<div><dt>{}</dt><dd>{value}</dd></div>", escape(name));
    }
    *html += "</dl>\n<p>Tables are in <code>tables/</code> as CSV, figures in <code>figures/</code>, \
             all numbers, commands and messages in <code>results.json</code>.</p>\n</section>\n";
}

/// Class of a section in the table of contents, and a remark.
fn standing(section: &WrittenSection) -> (&'static str, &'static str) {
    let missing = section.blocks().iter().any(|block| matches!(block, Block::Missing(_)));
    match &section.computed {
        None => ("not-yet", " <small>not computed yet</small>"),
        Some(computed) if computed.failed => ("failed", " <small>failed</small>"),
        Some(_) if missing => ("partial", " <small>something is missing</small>"),
        Some(_) => ("done", ""),
    }
}

/// A section; with `device`, where it was computed.
fn write_section(html: &mut String, section: &WrittenSection, device: bool) {
    let _ = writeln!(html, "<section id=\"{}\">\n<h3>{}</h3>", section.slug, escape(section.title));
    if let Some(computed) = section.computed.as_ref().filter(|_| device) {
        let _ = writeln!(html, "<p><small>On {}.</small></p>", escape(&computed.made.device));
    }
    if section.computed.is_none() {
        *html += "<p class=\"missing\">Not computed yet.</p>\n";
    }
    for block in section.blocks() {
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
    *html += "</section>\n";
}

fn write_list(html: &mut String, lines: &[String]) {
    *html += "<ul>";
    for line in lines {
        let _ = write!(html, "<li>{}</li>", inline(line));
    }
    *html += "</ul>\n";
}

fn write_table(html: &mut String, section: &WrittenSection, table: &Table) {
    let numeric: Vec<bool> = (0..table.columns.len())
        .map(|k| {
            let mut cells = table.rows.iter().map(|row| row[k].as_str()).filter(|c| !c.is_empty());
            cells.clone().next().is_some() && cells.all(is_number)
        })
        .collect();
    let class = |k: usize| if numeric.get(k) == Some(&true) { " class=\"number\"" } else { "" };
    *html += "<figure class=\"table\"><div class=\"scroll\"><table>\n<thead><tr>";
    for (k, column) in table.columns.iter().enumerate() {
        let _ = write!(html, "<th scope=\"col\"{}>{}</th>", class(k), inline(column));
    }
    *html += "</tr></thead>\n<tbody>\n";
    for row in &table.rows {
        *html += "<tr>";
        for (k, cell) in row.iter().enumerate() {
            // Short words stay on one line; a wide table scrolls.
            let class = match class(k) {
                "" if cell.chars().count() <= 34 => " class=\"short\"",
                class => class,
            };
            let _ = write!(html, "<td{class}>{}</td>", inline(cell));
        }
        *html += "</tr>\n";
    }
    let _ = writeln!(
        html,
        "</tbody></table></div>\n<figcaption><strong>{}.</strong> {} <a href=\"{}\">CSV</a></figcaption></figure>",
        inline(&table.title),
        inline(&table.note),
        table_file(section, &table.title)
    );
}

/// Whether a cell is a number, with a unit perhaps.
fn is_number(cell: &str) -> bool {
    let letters = cell.chars().filter(|c| c.is_alphabetic()).count();
    cell.starts_with(|c: char| "+-−".contains(c) || c.is_ascii_digit()) && letters <= 3
}

fn write_figure(html: &mut String, section: &WrittenSection, figure: &Figure) {
    let title = inline(&figure.title);
    let animated = if matches!(figure.picture, Picture::Gif(_)) { " animation" } else { "" };
    let _ = write!(html, "<figure class=\"picture{animated}\"><div class=\"scroll\">");
    match &figure.picture {
        Picture::Svg(text) => *html += &plot::inlined(text, &escape(&figure.title)),
        picture => {
            let _ = write!(
                html,
                "<img alt=\"{}\" src=\"data:image/{};base64,{}\">",
                escape(&figure.title),
                picture.suffix(),
                STANDARD.encode(picture.bytes())
            );
        }
    }
    let _ = writeln!(
        html,
        "</div>\n<figcaption><strong>{title}.</strong> {} <a href=\"{}\">file</a></figcaption></figure>",
        inline(&figure.caption),
        figure_file(section, figure)
    );
}

fn write_map(html: &mut String, section: &WrittenSection, map: &Map) {
    let plain = map.cells.iter().flatten().all(|(_, number)| number.is_empty());
    let class = if plain { "map plain" } else { "map" };
    let _ = write!(
        html,
        "<figure class=\"table\"><div class=\"scroll\"><table class=\"{class}\">\n<thead><tr>\
         <th>{} ↓<br>{} →</th>",
        inline(&map.y.0),
        inline(&map.x.0)
    );
    for value in &map.x.1 {
        let _ = write!(html, "<th scope=\"col\">{}</th>", inline(value));
    }
    *html += "</tr></thead>\n<tbody>\n";
    for (value, cells) in map.y.1.iter().zip(&map.cells) {
        let _ = write!(html, "<tr><th scope=\"row\">{}</th>", inline(value));
        for (outcome, number) in cells {
            let (word, sign, class) = outcome.words();
            let number = match number.as_str() {
                "" => String::new(),
                number => format!(" <small>{}</small>", inline(number)),
            };
            let _ = write!(html, "<td class=\"{class}\" title=\"{word}\">{sign}{number}</td>");
        }
        *html += "</tr>\n";
    }
    let _ = writeln!(
        html,
        "</tbody></table></div>\n<figcaption><strong>{}.</strong> {}. {} <a href=\"{}\">CSV</a></figcaption></figure>",
        inline(&map.title),
        escape(&map.legend()),
        inline(&map.caption),
        table_file(section, &map.title)
    );
}

/// Text with what stands between backticks as code.
fn inline(text: &str) -> String {
    let parts = text.split('`').enumerate().map(|(k, part)| match k % 2 {
        0 => escape(part),
        _ => format!("<code>{}</code>", escape(part)),
    });
    parts.collect()
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_told_from_words() {
        assert!(["3.5", "-2.0e-6", "8.96 %", "12 min"].into_iter().all(is_number));
        assert!(!["50 discs", "never", "100 discs + f64"].into_iter().any(is_number));
    }

    #[test]
    fn texts_cannot_break_the_page() {
        assert_eq!(
            inline("a < b & `x > \"y\"`"),
            "a &lt; b &amp; <code>x &gt; &quot;y&quot;</code>"
        );
    }
}
