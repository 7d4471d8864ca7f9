//! The results of a data set: a table for the terminal and a CSV file.

use std::fmt::Write;
use std::path::Path;

use files::{WriteError, csv_cell, write_text};

use super::case::Case;
use super::error::DatasetError;
use super::split::Split;
use crate::scene::Scene;
use crate::trajectory::{Field, Trajectory};

/// The result of one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Split of the case.
    pub split: Split,
    /// Name of the case.
    pub name: String,
    /// Its keys and values, as in [`Case::values`].
    pub values: String,
    /// Its class, as in [`Case::class`].
    pub class: String,
    /// The case of the same scene, as in [`Case::same_as`].
    pub same_as: Option<String>,
    /// Material points.
    pub points: usize,
    /// Discs of all points; 0 for a continuum law.
    pub discs: usize,
    /// Macro steps.
    pub steps: usize,
    /// Wall time of the finished run (s).
    pub seconds: Option<f64>,
    /// Right edge of the foremost point at the end of the finished run (m).
    pub front: Option<f64>,
    /// `ok`, doubts about the result, or the progress of the run.
    pub checks: String,
    /// Whether the file exists but cannot be read.
    pub damaged: bool,
}

impl Row {
    /// Whether the run is finished.
    pub fn is_finished(&self) -> bool {
        self.seconds.is_some()
    }

    /// The result of a case, from its file in `folder` if it exists.
    fn new(case: &Case, folder: &Path) -> Self {
        let mut row = Self::not_begun(case);
        if let Err(error) = row.read(case, folder) {
            row.checks = format!("damaged, delete it to make it again ({error})");
            row.damaged = true;
            row.seconds = None;
        }
        row
    }

    fn not_begun(case: &Case) -> Self {
        let scene = &case.scene;
        let points = scene.point_count();
        let discs = case.discs();
        Self {
            split: case.split,
            name: case.name.clone(),
            values: case.values.clone(),
            class: case.class.clone(),
            same_as: case.same_as.clone(),
            points,
            discs,
            steps: scene.steps(),
            seconds: None,
            front: None,
            checks: "not begun".to_owned(),
            damaged: false,
        }
    }

    fn read(&mut self, case: &Case, folder: &Path) -> Result<(), DatasetError> {
        let (path, scene) = (case.file(folder), &case.scene);
        if !path.exists() {
            return Ok(());
        }
        let trajectory = Trajectory::open(&path)?;
        if trajectory.header().scene != scene.text {
            self.checks = "made from another scene".to_owned();
            return Ok(());
        }
        if trajectory.status() != "finished" {
            let (frames, all) = (trajectory.frames(), scene.frames() + 1);
            self.checks = format!("{} ({frames} of {all} frames)", trajectory.status());
            return Ok(());
        }
        self.seconds = Some(trajectory.wall_time().values().sum());
        let last = trajectory.budget().get("front").and_then(|front| front.last());
        self.front = last.map(|x| (x + 0.5 * scene.domain.spacing()).min(scene.domain.size[0]));
        let doubts = doubts(&trajectory)?;
        self.checks = if doubts.is_empty() { "ok".to_owned() } else { doubts.join("; ") };
        Ok(())
    }
}

/// The rows of all cases.
pub fn rows(cases: &[Case], folder: &Path) -> Vec<Row> {
    cases.iter().map(|case| Row::new(case, folder)).collect()
}

/// Doubts about a finished trajectory: values that are not finite, points outside the domain, and the
/// warnings of the run itself, which include a step above its bound of guaranteed stability, growing energy
/// and material pressed into itself.
fn doubts(trajectory: &Trajectory) -> Result<Vec<String>, DatasetError> {
    let header = trajectory.header();
    let mut doubts = Vec::new();
    let (mut finite, mut inside) = (true, true);
    for index in 0..trajectory.frames() {
        for x in trajectory.positions(index..index + 1)?.rows() {
            inside &= (0..2).all(|k| (0.0..=header.domain[k]).contains(&x[k]));
        }
        for field in [Field::Velocity, Field::Stress] {
            let values = trajectory.field::<f64>(field, index..index + 1)?;
            finite &= values.iter().flatten().all(|value| value.is_finite());
        }
    }
    if !finite {
        doubts.push("not finite".to_owned());
    }
    if !inside {
        doubts.push("points outside".to_owned());
    }
    match trajectory.warnings() {
        Some(warnings) => doubts.extend(warnings.into_iter().map(str::to_owned)),
        None => doubts.push("made by an older version, which did not judge its runs".to_owned()),
    }
    Ok(doubts)
}

/// Cases that have not been run, as an aligned table.
pub fn list(cases: &[Case]) -> String {
    let head = ["scene", "seed", "points", "discs", "duration [s]", "bodies"];
    let mut lines = vec![head.map(str::to_owned)];
    lines.extend(cases.iter().map(|case| {
        [
            case.full_name(),
            case.scene.seed.to_string(),
            case.scene.point_count().to_string(),
            case.discs().to_string(),
            case.scene.duration.to_string(),
            bodies(&case.scene),
        ]
    }));
    aligned(&lines)
}

/// The bodies of a scene in words.
fn bodies(scene: &Scene) -> String {
    let count = |n: usize, one: &str, many: &str| match n {
        0 => None,
        1 => Some(format!("1 {one}")),
        n => Some(format!("{n} {many}")),
    };
    let parts = [
        count(scene.columns.len(), "column", "columns"),
        count(scene.obstacles.len(), "box", "boxes"),
        scene.plate.map(|_| "plate".to_owned()),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The rows as an aligned table.
pub fn table(rows: &[Row]) -> String {
    let number = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    let head = ["scene", "points", "discs", "steps", "seconds", "front [m]", "checks"];
    let mut lines = vec![head.map(str::to_owned)];
    lines.extend(rows.iter().map(|row| {
        [
            row.split.case(&row.name),
            row.points.to_string(),
            row.discs.to_string(),
            row.steps.to_string(),
            number(row.seconds, 1),
            number(row.front, 2),
            row.checks.clone(),
        ]
    }));
    aligned(&lines)
}

/// Lines of cells: the first and last column begin alike, the others end alike.
fn aligned<const N: usize>(lines: &[[String; N]]) -> String {
    let width = |column: usize| lines.iter().map(|line| line[column].len()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..N).map(width).collect();
    let mut text = String::new();
    for line in lines {
        write!(text, "{:<1$}", line[0], widths[0]).expect("writing to a string cannot fail");
        for (number, width) in line[1..N - 1].iter().zip(&widths[1..]) {
            write!(text, "  {number:>width$}").expect("writing to a string cannot fail");
        }
        writeln!(text, "  {}", line[N - 1]).expect("writing to a string cannot fail");
    }
    text
}

/// Writes the rows as CSV with a header.
///
/// # Errors
/// If the file cannot be written.
pub fn write_csv(rows: &[Row], path: &Path) -> Result<(), WriteError> {
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let mut text =
        "split,scene,points,discs,steps,seconds,front,checks,values,class,same_as\n".to_owned();
    for row in rows {
        let fields = [
            row.split.name().to_owned(),
            csv_cell(&row.name),
            row.points.to_string(),
            row.discs.to_string(),
            row.steps.to_string(),
            number(row.seconds),
            number(row.front),
            csv_cell(&row.checks),
            csv_cell(&row.values),
            csv_cell(&row.class),
            csv_cell(row.same_as.as_deref().unwrap_or("")),
        ];
        text += &(fields.join(",") + "\n");
    }
    write_text(path, &text)
}
