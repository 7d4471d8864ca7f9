//! The DEM against YADE, where that is installed.

use std::collections::BTreeMap;
use std::process::Command;

use miette::{IntoDiagnostic, WrapErr, bail};
use plot::{Axis, Chart, Mark, Series};
use serde::{Deserialize, Serialize};

use crate::block::{Block, Figure, Table};
use crate::context::Context;
use crate::machine::processor;
use crate::section::Section;
use crate::table::number;

/// One packing, one shear path, two codes.
pub struct Yade;

/// The comparison and its part that YADE runs; also commands of their own.
const SCRIPTS: [(&str, &str); 2] = [
    ("compare.py", include_str!("../../yade/compare.py")),
    ("shear.py", include_str!("../../yade/shear.py")),
];
/// Kind of the value that is kept.
const KIND: &str = "yade";
/// About, s.
const SECONDS: f64 = 60.0;
/// What is compared with YADE, and the name of each.
const OURS: [(&str, &str); 2] = [("f64", "this code, f64"), ("f32", "this code, f32")];
/// Parts of the path that are compared, by shear strain.
const PARTS: [[f64; 2]; 3] = [[0.0, 0.005], [0.005, 0.1], [0.1, 0.5]];

/// A comparison, which may have been made on another machine than the rest of the report.
#[derive(Serialize, Deserialize)]
struct Made {
    /// What YADE says of itself.
    version: String,
    /// The processor that both codes ran on.
    processor: String,
    found: Found,
}

/// What `compare.py` writes: by code ("f64", "f32", "yade").
#[derive(Serialize, Deserialize)]
struct Found {
    /// Disc-steps a second on one thread.
    speed: BTreeMap<String, f64>,
    /// Shear strain, pressure p and shear stress q (Pa) along the path.
    path: BTreeMap<String, Vec<[f64; 3]>>,
}

impl Section for Yade {
    fn title(&self) -> &'static str {
        "Constant-volume shear against YADE"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let key = format!("{}\n{}", SCRIPTS[0].1, SCRIPTS[1].1);
        let installed = Command::new("yade").arg("--version").output();
        if installed.is_err() && !context.work.has_cached(KIND, &key) {
            return Ok(vec![Block::missing(
                "The comparison with YADE",
                "the program `yade` is not installed.",
                "On Debian: `apt-get install yade`.",
            )]);
        }
        let program = context.work.program().to_owned();
        let made: Made = context.cached(KIND, &key, SECONDS, || {
            let version = installed.into_diagnostic()?.stdout;
            let version = String::from_utf8_lossy(&version).trim().to_owned();
            let folder = tempfile::tempdir().into_diagnostic()?;
            for (name, text) in SCRIPTS {
                std::fs::write(folder.path().join(name), text).into_diagnostic()?;
            }
            let json = folder.path().join("found.json");
            let output = Command::new("python3")
                .arg(folder.path().join("compare.py"))
                .arg("--dempm")
                .arg(&program)
                .arg("--json")
                .arg(&json)
                .output()
                .into_diagnostic()
                .wrap_err("cannot start python3")?;
            if !output.status.success() {
                bail!("compare.py: {}", String::from_utf8_lossy(&output.stderr).trim());
            }
            let text = std::fs::read(json).into_diagnostic()?;
            let found = serde_json::from_slice(&text)
                .into_diagnostic()
                .wrap_err("what compare.py wrote")?;
            Ok(Made { version, processor: processor(), found })
        })?;
        let Made { version, processor, found } = made;
        let mut table = Table::new(
            "Differences from YADE",
            ["code", "disc-steps/s", "over YADE", "p to 0.5 %", "p to 10 %", "p to 50 %"],
        )
        .note(
            "Speed on one thread each. Pressure: mean relative difference over strains up to 0.5 %, \
             from there to 10 %, and from there to 50 %.",
        );
        let speed = |code: &str| found.speed.get(code).copied().unwrap_or(f64::NAN);
        for (code, name) in OURS {
            let ratio = number(speed(code) / speed("yade"));
            let head = [name.to_owned(), format!("{:.2e}", speed(code)), ratio];
            let parts = PARTS.map(|part| percent(found.difference(code, part)));
            table.row(head.into_iter().chain(parts));
        }
        table.row(["YADE".to_owned(), format!("{:.2e}", speed("yade"))]);
        let finding = format!(
            "Up to a shear of 0.5 % the pressure of one packing (f64) \
             differs by {}; then chaos parts all codes, f32 from f64 as well. On one thread this code makes {} (f64) and {} (f32) times as \
             many disc-steps a second as YADE.",
            percent(found.difference("f64", PARTS[0])),
            number(speed("f64") / speed("yade")),
            number(speed("f32") / speed("yade")),
        );
        Ok(vec![
            Block::headline(finding),
            Block::text(format!(
                "One dense packing of 400 discs at 20 kPa, simple shear at constant volume, the same \
                 steps in both codes (`validation/yade/compare.py`, {version}), one thread of {processor} each. \
                 Chaos parts the two at strains above 1 %: from there on only means can agree.",
            )),
            found.chart("pressure p [kPa]", |[_, p, _]| 1e-3 * p)?,
            found.chart("q / p", |[_, p, q]| q / p)?,
            Block::Table(table),
        ])
    }
}

impl Found {
    /// Mean relative difference in pressure from YADE over a part of the path.
    fn difference(&self, code: &str, [from, to]: [f64; 2]) -> f64 {
        let (Some(ours), Some(theirs)) = (self.path.get(code), self.path.get("yade")) else {
            return f64::NAN;
        };
        let differences: Vec<f64> = ours
            .iter()
            .zip(theirs)
            .filter(|([strain, ..], _)| from < *strain && *strain <= to)
            .map(|(a, b)| (a[1] / b[1] - 1.0).abs())
            .collect();
        differences.iter().sum::<f64>() / differences.len() as f64
    }

    fn chart(&self, label: &str, value: fn([f64; 3]) -> f64) -> miette::Result<Block> {
        let codes = OURS.into_iter().chain([("yade", "YADE")]);
        let line = |(code, name): (&str, &str)| {
            let path = self.path.get(code).into_iter().flatten();
            Series::new(name, Mark::Line, path.map(|row| (row[0], value(*row))).collect())
        };
        let (x, y) = (Axis::linear("shear strain"), Axis::linear(label));
        let picture = Chart { x, y, series: codes.map(line).collect(), floor: None }
            .svg()
            .map(crate::figure::Picture::Svg)?;
        let caption = "One packing, one path; the lines part where chaos has grown.";
        Ok(Block::Figure(Figure::new(format!("Path: {label}"), picture, caption)))
    }
}

fn percent(part: f64) -> String {
    format!("{} %", number(100.0 * part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pressures_are_compared_over_a_part_of_the_path() {
        let path = |p: [f64; 3]| (0..3).map(|k| [0.1 * k as f64, p[k], 1.0]).collect::<Vec<_>>();
        let paths = [("f64", path([1.0, 2.2, 4.4])), ("yade", path([1.0, 2.0, 4.0]))];
        let path = paths.map(|(code, path)| (code.to_owned(), path)).into();
        let found = Found { speed: BTreeMap::new(), path };
        assert!((found.difference("f64", [0.0, 0.3]) - 0.1).abs() < 1e-12);
        assert_eq!(found.difference("f64", [-0.1, 0.05]), 0.0);
        assert!(found.difference("f32", [0.0, 0.3]).is_nan());
    }
}
