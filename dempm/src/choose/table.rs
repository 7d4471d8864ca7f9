//! [`Choice`] as a table.

use std::fmt;

use super::choice::{Choice, Entry};
use super::error_model::Expected;
use super::judgement::Judgement;
use crate::check::{bytes, duration, quantity};

const HEAD: [&str; 6] = ["", "expected", "bound", "time", "memory", ""];

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let within = quantity(self.within, "m");
        writeln!(f, "{}: within {within} of its grains computed one by one\n", self.scene)?;
        let rows: Vec<[String; 6]> =
            self.candidates.iter().enumerate().map(|(k, entry)| self.row(k, entry)).collect();
        let width = |column: usize| {
            let cells = rows.iter().map(|row| row[column].chars().count());
            cells.max().unwrap_or(0).max(HEAD[column].len())
        };
        let widths: Vec<usize> = (0..HEAD.len()).map(width).collect();
        for row in std::iter::once(&HEAD.map(str::to_owned)).chain(&rows) {
            let [name, median, bound, time, memory, note] = row;
            let line = format!(
                "{name:a$}  {median:>b$}  {bound:>c$}  {time:>d$}  {memory:>e$}  {note}",
                a = widths[0],
                b = widths[1],
                c = widths[2],
                d = widths[3],
                e = widths[4],
            );
            writeln!(f, "{}", line.trim_end())?;
        }
        writeln!(f, "\n{}", self.verdict())?;
        write!(
            f,
            "\nExpected and bound: the largest distance over time of squares of material, root mean square; half and nine\n\
             of ten are smaller. Fitted to {}.",
            self.measured
        )
    }
}

impl fmt::Display for Judgement {
    /// Lines for the summary of a run.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let metres = |value: f64| quantity(value, "m");
        let mut line = |label: &str, value: String| writeln!(f, "  {label:<22}{value}");
        let chosen = &self.chosen;
        line("model", chosen.model.clone())?;
        let expected = match (chosen.expected, chosen.bound) {
            (Some(expected), Some(bound)) => {
                format!("{}, in nine of ten scenes below {}", metres(expected), metres(bound))
            }
            _ => "unknown, as nothing like this scene was measured".to_owned(),
        };
        line("distance from discs", expected)?;
        if let (Some(change), Some(estimate)) = (self.change, self.estimate) {
            let Expected { median, bound } = estimate;
            let [median, bound, change] = [median, bound, change].map(metres);
            line(
                "the run itself says",
                format!("{median}, below {bound}; the next coarser is {change} away"),
            )?;
        }
        Ok(())
    }
}

impl Choice {
    fn row(&self, index: usize, entry: &Entry) -> [String; 6] {
        let mark = if index == self.taken { "> " } else { "  " };
        let metres =
            |value: Option<f64>| value.map_or("-".to_owned(), |value| quantity(value, "m"));
        let expected = entry.expected();
        [
            format!("{mark}{}", entry.name),
            metres(expected.map(|expected| expected.median)),
            metres(expected.map(|expected| expected.bound)),
            entry.seconds.map_or("-".to_owned(), duration),
            entry.memory.map_or("-".to_owned(), bytes),
            entry.out.clone().unwrap_or_default(),
        ]
    }

    /// What is taken and why, in a sentence.
    pub fn verdict(&self) -> String {
        let entry = self.taken();
        let within = quantity(self.within, "m");
        let bound = entry.bound().map_or("unknown".to_owned(), |bound| quantity(bound, "m"));
        if !self.beyond.is_empty() && entry.expected().is_none() {
            return format!(
                "Nothing like this scene was measured ({}): {}, the finest that can be computed; its error is unknown.",
                self.beyond.join(", "),
                entry.name
            );
        }
        if self.met {
            format!(
                "{}: the cheapest that stays within {within} in nine of ten scenes (bound {bound}).",
                entry.name
            )
        } else {
            format!(
                "None stays within {within} in nine of ten scenes. Nearest: {}, bound {bound}.",
                entry.name
            )
        }
    }
}
