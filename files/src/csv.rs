//! Cells of CSV files.

/// A cell of a CSV file (RFC 4180), in quotation marks where its text needs them.
pub fn csv_cell(text: &str) -> String {
    let plain = !text.contains([',', '"', '\n']);
    if plain { text.to_owned() } else { format!("\"{}\"", text.replace('"', "\"\"")) }
}

#[cfg(test)]
mod tests {
    use super::csv_cell;

    #[test]
    fn texts_with_commas_are_quoted() {
        assert_eq!(csv_cell("ok"), "ok");
        assert_eq!(csv_cell("a = [1, 2], b = \"x\""), "\"a = [1, 2], b = \"\"x\"\"\"");
    }
}
