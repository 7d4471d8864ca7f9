//! The table of measured cases.

use std::fmt::Write;

use super::family::Family;
use super::features::{Features, NAMES};

/// Columns besides the features.
const BEFORE: [&str; 3] = ["scene", "candidate", "family"];
const AFTER: [&str; 8] = [
    "height [m]",
    "end [m]",
    "largest [m]",
    "change at the end [m]",
    "largest change [m]",
    "seconds",
    "seconds of preparation",
    "failure",
];

/// A candidate on a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of the scene.
    pub scene: String,
    /// Name of the candidate.
    pub candidate: String,
    /// Its kind.
    pub family: Family,
    /// What was known before.
    pub features: Features,
    /// Height of the highest pile (m).
    pub height: f64,
    /// Distance from the truth (m) at the end, and the largest over time; `None` if it failed.
    pub distance: Option<Distance>,
    /// Distance (m) from the next coarser candidate of the same kind; `None` of the coarsest.
    pub change: Option<Distance>,
    /// Wall time (s) of the run and of its preparation, beside others.
    pub seconds: [f64; 2],
    /// Why it failed.
    pub failure: String,
}

/// A root mean square distance (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// At the end.
    pub end: f64,
    /// The largest over time.
    pub largest: f64,
}

/// The first line of the table.
pub fn head() -> String {
    let names = BEFORE.iter().chain(&NAMES).chain(&AFTER);
    names.copied().collect::<Vec<_>>().join(",")
}

impl Case {
    /// Its line.
    pub fn line(&self) -> String {
        let mut line =
            [&self.scene, &self.candidate, self.family.name()].map(files::csv_cell).join(",");
        let mut add = |value: f64| {
            // Writing to a string cannot fail.
            let _ = write!(line, ",{}", rounded(value));
        };
        self.features.into_iter().for_each(&mut add);
        add(self.height);
        for distance in [self.distance, self.change] {
            add(distance.map_or(f64::NAN, |distance| distance.end));
            add(distance.map_or(f64::NAN, |distance| distance.largest));
        }
        self.seconds.into_iter().for_each(&mut add);
        line + "," + &files::csv_cell(&self.failure)
    }
}

/// Four significant digits; nothing of no number.
fn rounded(value: f64) -> String {
    if !value.is_finite() {
        return String::new();
    }
    let digits = 3 - if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    let scale = 10.0_f64.powi(digits.clamp(-12, 12));
    format!("{}", (value * scale).round() / scale)
}

/// Reads a table.
///
/// # Errors
/// A sentence that names the line, if it has another form.
pub fn read(text: &str) -> Result<Vec<Case>, String> {
    let mut lines = text.lines();
    if lines.next() != Some(head().as_str()) {
        return Err("line 1: the head is not that of a table of measured cases".to_owned());
    }
    let numbered = lines.enumerate().filter(|(_, line)| !line.is_empty());
    numbered
        .map(|(index, line)| parse(line).ok_or_else(|| format!("line {}: not a case", index + 2)))
        .collect()
}

fn parse(line: &str) -> Option<Case> {
    let cells = cells(line);
    if cells.len() != BEFORE.len() + NAMES.len() + AFTER.len() {
        return None;
    }
    let number = |place: usize| cells[place].parse::<f64>().ok();
    let mut features = [0.0; NAMES.len()];
    for (place, feature) in features.iter_mut().enumerate() {
        *feature = number(BEFORE.len() + place)?;
    }
    let after = BEFORE.len() + NAMES.len();
    let distance =
        |place: usize| Some(Distance { end: number(place)?, largest: number(place + 1)? });
    Some(Case {
        scene: cells[0].clone(),
        candidate: cells[1].clone(),
        family: Family::named(&cells[2])?,
        features,
        height: number(after)?,
        distance: distance(after + 1),
        change: distance(after + 3),
        seconds: [number(after + 5).unwrap_or(f64::NAN), number(after + 6).unwrap_or(f64::NAN)],
        failure: cells[after + 7].clone(),
    })
}

/// The cells of a line, as RFC 4180 quotes them.
fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut quoted = false;
    let mut characters = line.chars().peekable();
    while let Some(character) = characters.next() {
        let last = cells.len() - 1;
        match character {
            '"' if quoted && characters.peek() == Some(&'"') => {
                characters.next();
                cells[last].push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            other => cells[last].push(other),
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case() -> Case {
        let mut features = [0.0; NAMES.len()];
        features[0] = -4.605;
        Case {
            scene: "train/falls-001".into(),
            candidate: "mu(I), cells of 31.3 mm".into(),
            family: Family::MuI,
            features,
            height: 0.75,
            distance: Some(Distance { end: 0.01234, largest: 0.02 }),
            change: None,
            seconds: [1.5, 0.0],
            failure: String::new(),
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let failed = Case {
            distance: None,
            seconds: [1.0, 2.0],
            failure: "a \"point\", left".into(),
            ..case()
        };
        let all = [case(), failed];
        let text = [head(), all[0].line(), all[1].line()].join("\n");
        assert_eq!(read(&text).unwrap(), all);
        assert_eq!(read(&head()), Ok(Vec::new()));
        let wrong = text.replace("-4.605", "x");
        assert_eq!(read(&wrong), Err("line 2: not a case".to_owned()));
        assert!(read("scene\n").unwrap_err().contains("line 1"));
    }

    #[test]
    fn numbers_have_four_digits() {
        let found = [123_456.0, 0.012_345_6, -2.0, 0.0, f64::NAN].map(rounded);
        assert_eq!(found, ["123500", "0.01235", "-2", "0", ""]);
    }
}
