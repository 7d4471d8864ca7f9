//! Tables in Markdown that are also readable as they are.

/// A table; columns of numbers are aligned to the right, the first one to the left.
pub fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells.chain([head[column].chars().count(), 3]).max().unwrap_or(3)
    };
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let cells = cells.zip(&widths).enumerate().map(|(column, (cell, width))| match column {
            0 => format!(" {cell:<width$} |"),
            _ => format!(" {cell:>width$} |"),
        });
        format!("|{}\n", cells.collect::<String>())
    };
    let rule = widths.iter().enumerate().map(|(column, width)| match column {
        0 => format!("{}|", "-".repeat(width + 2)),
        _ => format!("{}:|", "-".repeat(width + 1)),
    });
    let mut text = line(&mut head.iter().copied());
    text += &format!("|{}\n", rule.collect::<String>());
    for row in rows {
        text += &line(&mut row.iter().map(String::as_str));
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn columns_line_up() {
        let rows = [vec!["µs".to_owned(), "1.5".to_owned()], vec!["long name".into(), "12".into()]];
        let expected = "| a         |   n |\n|-----------|----:|\n| µs        | 1.5 |\n\
                        | long name |  12 |\n";
        assert_eq!(super::table(&["a", "n"], &rows), expected);
    }
}
