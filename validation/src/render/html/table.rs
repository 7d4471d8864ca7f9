//! Tables and maps.

use std::fmt::Write as _;

use super::text::{escape, inline};
use crate::render::map::Map;
use crate::render::report::ReportSection;
use crate::render::table::Table;

/// The page has no more than the first rows of a longer table; the CSV file has all.
const MOST_ROWS: usize = 30;
/// Rows that it has of such a table.
const FIRST_ROWS: usize = 10;
/// Cells up to this length stay on one line.
const SHORT: usize = 34;

/// Writes a table. On narrow screens each row becomes a list of labelled values.
pub(super) fn write_table(html: &mut String, section: &ReportSection, table: &Table) {
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
    let count = table.rows.len();
    let shown = if count > MOST_ROWS { FIRST_ROWS } else { count };
    for row in &table.rows[..shown] {
        *html += "<tr>";
        for (k, cell) in row.iter().enumerate() {
            let class = match class(k) {
                "" if cell.chars().count() <= SHORT => " class=\"short\"",
                class => class,
            };
            let label = table.columns.get(k).map_or(String::new(), |column| escape(column));
            let _ = write!(html, "<td{class} data-label=\"{label}\">{}</td>", inline(cell));
        }
        *html += "</tr>\n";
    }
    let file = section.table_file(&table.title);
    let link = if shown < count {
        format!("The first {shown} of {count} rows; <a href=\"{file}\">all rows as CSV</a>")
    } else {
        format!("<a href=\"{file}\">CSV</a>")
    };
    let _ = writeln!(
        html,
        "</tbody></table></div>\n<figcaption><strong>{}.</strong> {} {link}</figcaption></figure>",
        inline(&table.title),
        inline(&table.note),
    );
}

/// Whether a cell is a number, perhaps with a unit.
fn is_number(cell: &str) -> bool {
    let letters = cell.chars().filter(|c| c.is_alphabetic()).count();
    cell.starts_with(|c: char| "+-−".contains(c) || c.is_ascii_digit()) && letters <= 3
}

/// Writes a map as a table of symbols and numbers. Narrow screens have the symbols only.
pub(super) fn write_map(html: &mut String, section: &ReportSection, map: &Map) {
    let plain = map.cells.iter().flatten().all(|(_, number)| number.is_empty());
    let wide = map.x.1.len() > 10;
    let class =
        ["map", if plain { " plain" } else { "" }, if wide { " wide" } else { "" }].concat();
    let _ = write!(
        html,
        "<figure class=\"table\"><div class=\"scroll\"><table class=\"{class}\">\n<thead><tr>\
         <th>{} ↓<br>{} →</th>",
        inline(&map.y.0),
        inline(&map.x.0)
    );
    for value in &map.x.1 {
        let _ = write!(html, "<th scope=\"col\"><span>{}</span></th>", inline(value));
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
        section.table_file(&map.title)
    );
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
    fn of_a_long_table_the_page_has_the_first_rows() {
        let section = ReportSection::new("Runs", "", None);
        let html = |rows: usize| {
            let mut table = Table::new("All", ["run"]);
            (0..rows).for_each(|k| table.row([format!("run {k}")]));
            let mut html = String::new();
            write_table(&mut html, &section, &table);
            html
        };
        assert_eq!(html(MOST_ROWS).matches("<td").count(), MOST_ROWS);
        let long = html(MOST_ROWS + 1);
        assert_eq!(long.matches("<td").count(), FIRST_ROWS);
        assert!(long.contains("The first 10 of 31 rows") && long.contains("tables/runs--all.csv"));
    }
}
