//! The whole page.

use std::collections::HashSet;
use std::fmt::Write as _;

use super::first_screen::{write_first_screen, write_headlines};
use super::section::{standing, write_section};
use super::text::{escape, inline};
use crate::render::report::{Facts, NOTE, ReportChapter};

const STYLE: &str = include_str!("style.css");
/// Opens the folded section that a link leads to.
const SCRIPT: &str = "<script>\nconst open = () => {\n  \
     const section = document.getElementById(decodeURIComponent(location.hash.slice(1)));\n  \
     const details = section && section.querySelector('details');\n  \
     if (details) { details.open = true; section.scrollIntoView(); }\n};\n\
     addEventListener('hashchange', open);\naddEventListener('load', open);\n</script>\n";
/// A fact of more lines is folded.
const MOST_LINES: usize = 4;

/// The page of a report. `facts` state what it was made with.
pub fn page(facts: &Facts, chapters: &[ReportChapter]) -> String {
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>DEMPM validation report</title>\n<style>\n{STYLE}{}</style>\n</head>\n<body>\n\
         <header><h1>DEMPM validation report</h1>\n",
        plot::dark_style()
    );
    html += "<p>A pile of grains collapses. It can be computed grain by grain, with a packing of grains in every \
             point of a coarser model, or with a formula for flowing grains, and predicted by networks that \
             learnt from such runs. How long does each take, and how far off is it?</p>\n";
    write_first_screen(&mut html, chapters);
    for (_, note) in facts.iter().filter(|(name, _)| name == NOTE) {
        let _ = writeln!(html, "<p class=\"note\">{}</p>", inline(note));
    }
    html += "</header>\n<nav>";
    let all = chapters;
    let chapters = || all.iter().filter(|chapter| !chapter.sections.is_empty());
    for chapter in chapters() {
        let _ = write!(html, "<div><h2>{}</h2><ul>", escape(&chapter.title));
        for section in &chapter.sections {
            let (class, remark) = standing(section);
            let (slug, title) = (&section.slug, escape(&section.title));
            let _ =
                write!(html, "<li class=\"{class}\"><a href=\"#{slug}\">{title}</a>{remark}</li>");
        }
        html += "</ul></div>";
    }
    html += "</nav>\n<main>\n";
    write_headlines(&mut html, all);
    let devices: HashSet<&str> = chapters()
        .flat_map(|chapter| &chapter.sections)
        .filter_map(|section| Some(section.computed.as_ref()?.made.device.as_str()))
        .collect();
    for chapter in chapters() {
        let _ = writeln!(
            html,
            "<h2 class=\"chapter\">{}</h2>\n<p>{}</p>",
            escape(&chapter.title),
            inline(&chapter.about)
        );
        for section in &chapter.sections {
            write_section(&mut html, section, devices.len() > 1);
        }
    }
    write_facts(&mut html, facts);
    html += "</main>\n";
    html += SCRIPT;
    html += "</body>\n</html>\n";
    html
}

/// What the page was made with.
fn write_facts(html: &mut String, facts: &Facts) {
    *html += "<section id=\"facts\"><details><summary><h3>Versions, devices, commands</h3>\
              <p>What this report was made with, and where.</p></summary>\n<dl class=\"facts\">";
    for (name, value) in facts {
        let (lines, mut value) = (value.lines().count(), escape(value));
        if lines > MOST_LINES {
            value = format!("<details><summary>{lines} entries</summary>{value}</details>");
        }
        let _ = write!(html, "<div><dt>{}</dt><dd>{value}</dd></div>", escape(name));
    }
    *html += "</dl>\n<p>Tables are in <code>tables/</code> as CSV, figures in <code>figures/</code>, \
             all numbers, commands and messages in <code>results.json</code>.</p>\n\
             </details></section>\n";
}
