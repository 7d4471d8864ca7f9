//! `surrogate rollout --scenes`: predicts many scenes at a time.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use dempm::dataset;
use files::{Interrupt, announce, csv_cell, note, refuse_input, write_text};
use miette::bail;

use super::progress::Progress;
use super::rollout_group::{From, Job, Request, Row, predict};
use crate::data::trajectories_in;
use crate::simulator::Simulator;
use crate::workers::for_all;

/// Scenes that share a GPU frame by frame: together they keep it busy, alone most of it is idle.
const TOGETHER: usize = 8;

/// What is asked for.
pub(super) struct Many<'a> {
    /// The model's file.
    pub(super) model: &'a Path,
    /// A list of scenes, or a folder of trajectories.
    pub(super) list: &'a Path,
    /// Folder of the predictions.
    pub(super) output: &'a Path,
    /// Frames of each; none for those of scene or trajectory.
    pub(super) frames: Option<usize>,
    /// Whether to replace predictions that are there.
    pub(super) overwrite: bool,
}

/// Predicts all scenes of a list into a folder, with a table of all.
///
/// # Errors
/// If the list or a scene cannot be used, files are in the way or cannot be written, or predictions fail (after all
/// others are written).
pub(super) fn rollout_many(
    many: &Many<'_>,
    simulator: &Simulator,
    interrupt: &Interrupt,
) -> miette::Result<()> {
    let jobs = jobs(many)?;
    for job in &jobs {
        if job.output.exists() && !many.overwrite {
            bail!(help = "--overwrite replaces it", "{}: is there already", job.output.display());
        }
        refuse_input(&job.output, [many.model, many.list])?;
    }
    let (began, done) = (Instant::now(), AtomicUsize::new(0));
    let progress = std::sync::Mutex::new(Progress::of_scenes(jobs.len() as u64));
    let at_a_time = if simulator.gpu.is_some() { TOGETHER } else { 1 };
    let request = Request { model: many.model, frames: many.frames };
    let groups: Vec<&[Job]> = jobs.chunks(at_a_time).collect();
    let rows = for_all(simulator, &groups, |simulator, group| {
        let rows = predict(&request, simulator, group, interrupt);
        if let Ok(progress) = progress.lock() {
            progress.set((done.fetch_add(group.len(), Relaxed) + group.len()) as u64);
        }
        rows
    })?;
    if let Ok(progress) = progress.lock() {
        progress.finish();
    }
    let seconds = began.elapsed().as_secs_f64();
    let mut table =
        "scene,points,frames,seconds,expected_error,error_bound,outside,status\n".to_owned();
    let (mut predicted, mut failed) = (0, Vec::new());
    for (job, row) in jobs.iter().zip(rows.into_iter().flatten()) {
        let name = name_in(many.output, &job.output);
        match row {
            Ok(row) => {
                let status = status(&row);
                predicted += row.recorded.frames;
                if status != "finished" {
                    failed.push(name.clone());
                }
                table += &line(&name, &row, &status);
            }
            Err(error) => {
                note!("{name}: {error:?}");
                failed.push(name);
            }
        }
    }
    let summary = many.output.join("rollouts.csv");
    write_text(&summary, &table)?;
    announce!(
        "{}: {} scenes, {predicted} frames in {seconds:.1} s; {}",
        many.output.display(),
        jobs.len(),
        summary.display()
    );
    if failed.is_empty() { Ok(()) } else { bail!("failed: {}", failed.join(", ")) }
}

/// The name of an output within the folder, without its ending.
fn name_in(folder: &Path, output: &Path) -> String {
    output.strip_prefix(folder).unwrap_or(output).with_extension("").display().to_string()
}

fn jobs(many: &Many<'_>) -> miette::Result<Vec<Job>> {
    if many.list.is_dir() {
        let job = |path: PathBuf| Job {
            output: many.output.join(path.file_name().unwrap_or_default()),
            from: From::Trajectory(path),
        };
        return Ok(trajectories_in(many.list)?.into_iter().map(job).collect());
    }
    let job = |case: dataset::Case| Job {
        output: case.file(many.output),
        from: From::Scene(Box::new(case.scene)),
    };
    Ok(dataset::cases(many.list)?.into_iter().map(job).collect())
}

fn status(row: &Row) -> String {
    match &row.recorded.failure {
        Some(error) => format!("failed: {error}"),
        None if row.recorded.frames < row.frames => "interrupted".to_owned(),
        None => "finished".to_owned(),
    }
}

fn line(name: &str, row: &Row, status: &str) -> String {
    let metres = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.4e}"));
    let expected = row.recorded.expected;
    let outside: Vec<&str> = row.outside.iter().chain(&row.warnings).map(String::as_str).collect();
    let cells = [
        csv_cell(name),
        row.points.to_string(),
        row.recorded.frames.to_string(),
        format!("{:.3}", row.recorded.seconds),
        metres(expected.map(|error| error.median)),
        metres(expected.map(|error| error.bound)),
        csv_cell(&outside.join("; ")),
        csv_cell(status),
    ];
    cells.join(",") + "\n"
}
