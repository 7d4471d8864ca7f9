//! From files of another program to a folder of trajectories.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use files::{refuse_input, utc_now};
use ndarray::{Array3, ArrayView2, Axis};

use super::bodies::Bodies;
use super::error::ImportError;
use super::foreign::Foreign;
use super::metadata::Metadata;
use super::scene_text::{Grid, plate, scene_text};
use super::{gns, lagrangebench};
use crate::dataset::{self, DataSet, Split};
use crate::scene::Scene;
use crate::trajectory::{Frame, Header, Points, TrajectoryWriter};

/// Read beside the files and written beside the trajectories.
const METADATA: &str = "metadata.json";

/// Formats of other programs.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// .npz files of geoelements/gns
    Gns,
    /// .h5 files of LagrangeBench
    Lagrangebench,
}

impl Format {
    fn name(self) -> &'static str {
        match self {
            Self::Gns => "gns",
            Self::Lagrangebench => "lagrangebench",
        }
    }

    fn ending(self) -> &'static str {
        match self {
            Self::Gns => "npz",
            Self::Lagrangebench => "h5",
        }
    }
}

/// An imported trajectory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Imported {
    /// The file.
    pub path: PathBuf,
    /// Frames.
    pub frames: usize,
    /// Particles that move freely.
    pub points: usize,
    /// Boxes that kinematic particles became.
    pub boxes: usize,
    /// Whether the scene in the file has all of them: a box that moves other than a plate is missing.
    pub all_in_scene: bool,
}

/// Imports a file, or `train`, `valid` and `test` of a folder, with the `metadata.json` beside. Files with
/// these names go to folders of `output` with these names, others into `output` itself. Calls `done` for
/// every trajectory; if there are training trajectories, writes their statistics to `metadata.json`.
///
/// # Errors
/// If a file or its metadata cannot be read, data are not two-dimensional or have no walls, kinematic
/// particles form no rectangles, `output` holds trajectories, or a file cannot be written.
pub fn import(
    source: &Path,
    format: Format,
    output: &Path,
    done: &mut dyn FnMut(&Imported),
) -> Result<(), ImportError> {
    let files = sources(source, format)?;
    let mut targets = Vec::new();
    for (path, split) in files {
        let folder = path.parent().unwrap_or(Path::new(""));
        let metadata = Metadata::read(folder, split)?;
        refuse_input(&output.join(METADATA), [&folder.join(METADATA)])?;
        let target = split.map_or(output.to_owned(), |split| output.join(split.name()));
        refuse_folder(&target, &path)?;
        targets.push((path, metadata, target));
    }
    for (path, metadata, target) in &targets {
        let mut number = 0;
        let mut write = |foreign: Foreign| {
            let file = target.join(format!("{number:03}.h5"));
            number += 1;
            done(&write_trajectory(foreign, metadata, format, &file)?);
            Ok(())
        };
        match format {
            Format::Gns => gns::each(path, &mut write)?,
            Format::Lagrangebench => lagrangebench::each(path, &mut write)?,
        }
        if number == 0 {
            let problem = "there is no trajectory in it".to_owned();
            return Err(ImportError::Shape { place: path.display().to_string(), problem });
        }
    }
    let set = DataSet::open(output)?;
    if !set.files(Split::Train).is_empty() {
        dataset::Metadata::of(&set)?.write(output)?;
    }
    Ok(())
}

/// The files to import and what they are.
fn sources(source: &Path, format: Format) -> Result<Vec<(PathBuf, Option<Split>)>, ImportError> {
    let ending = format.ending();
    let kind = std::fs::metadata(source).map_err(ImportError::read(source))?;
    if !kind.is_dir() {
        let stem = source.file_stem().unwrap_or_default();
        let split = Split::ALL.into_iter().find(|split| stem == split.name());
        return Ok(vec![(source.to_owned(), split)]);
    }
    let names =
        Split::ALL.map(|split| (source.join(format!("{}.{ending}", split.name())), Some(split)));
    let found: Vec<_> = names.into_iter().filter(|(path, _)| path.is_file()).collect();
    if found.is_empty() {
        let names = format!("train.{ending}, valid.{ending} or test.{ending}");
        return Err(ImportError::NoSplit { path: source.to_owned(), names });
    }
    Ok(found)
}

/// Refuses a folder with trajectories, which could be inputs, or which would be mixed with the new ones.
fn refuse_folder(folder: &Path, input: &Path) -> Result<(), ImportError> {
    refuse_input(&folder.join("000.h5"), [input])?;
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    let trajectory = |path: PathBuf| path.extension().is_some_and(|ending| ending == "h5");
    match entries.flatten().any(|entry| trajectory(entry.path())) {
        true => Err(ImportError::NotEmpty { path: folder.to_owned() }),
        false => Ok(()),
    }
}

/// Writes a trajectory whose domain begins at the origin.
fn write_trajectory(
    mut foreign: Foreign,
    metadata: &Metadata,
    format: Format,
    path: &Path,
) -> Result<Imported, ImportError> {
    let [[left, right], [bottom, top]] = metadata.bounds;
    let grid = Grid::fit([right - left, top - bottom], metadata.radius);
    for positions in [&mut foreign.material, &mut foreign.rigid] {
        for mut x in positions.rows_mut() {
            x[0] -= left;
            x[1] -= bottom;
        }
    }
    let Foreign { place, material, rigid } = foreign;
    let spacing =
        metadata.spacing.unwrap_or_else(|| neighbour_distance(material.index_axis(Axis(0), 0)));
    let misfit = |problem| ImportError::Bodies { place: place.clone(), problem };
    let bodies = Bodies::find(&rigid, &material, grid.domain, spacing).map_err(misfit)?;
    let interval = metadata.interval;
    let text = scene_text(&place, grid, &bodies, &material, interval)
        .ok_or_else(|| misfit("no particle has room beside the boxes".to_owned()))?;
    let scene = Scene::parse(&text, &format!("{place}, scene"))?;
    let header = header(&scene, metadata, format, spacing);
    let points = material.dim().1;
    let properties = Points { mass: vec![1.0; points], column: vec![0; points] };
    let mut writer = TrajectoryWriter::create(path, &header, &properties)?;
    for index in 0..material.dim().0 {
        writer.push(frame(index, &material, &bodies, interval))?;
    }
    let frames = writer.frames();
    writer.finish("finished")?;
    let moving = bodies.boxes().iter().any(|body| !body.path.is_empty());
    Ok(Imported {
        path: path.to_owned(),
        frames,
        points,
        boxes: bodies.boxes().len(),
        all_in_scene: !moving || plate(&bodies, interval, grid.cell).is_some(),
    })
}

fn header(scene: &Scene, metadata: &Metadata, format: Format, spacing: f64) -> Header {
    let [width, height] = scene.domain.size;
    let [[left, _], [bottom, _]] = metadata.bounds;
    let text = str::to_owned;
    Header {
        title: scene.title.clone(),
        scene: scene.text.clone(),
        seed: scene.seed,
        created: utc_now(),
        versions: BTreeMap::from([(text("dempm"), text(env!("CARGO_PKG_VERSION")))]),
        device: text("unknown"),
        precision: text("f32"),
        material: format!("imported ({})", format.name()),
        domain: scene.domain.size,
        gravity: scene.gravity,
        grid_cell: scene.domain.cell,
        point_spacing: spacing,
        time_step: scene.step,
        frame_interval: metadata.interval,
        parameters: BTreeMap::from([
            (text("connectivity_radius"), metadata.radius),
            (text("origin_x"), left),
            (text("origin_y"), bottom),
        ]),
        walls: vec![
            [0.0, 0.0, 0.0, height],
            [width, 0.0, width, height],
            [0.0, 0.0, width, 0.0],
            [0.0, height, width, height],
        ],
    }
}

/// A frame with velocities as differences to the frame before, in the first frame to the one after.
fn frame(index: usize, material: &Array3<f64>, bodies: &Bodies, interval: f64) -> Frame {
    let vectors = |frame: usize| -> Vec<[f64; 2]> {
        material.index_axis(Axis(0), frame).rows().into_iter().map(|x| [x[0], x[1]]).collect()
    };
    let (before, after) = (vectors(index.max(1) - 1), vectors(index.max(1)));
    let rate = |(a, b): (&[f64; 2], &[f64; 2])| [0, 1].map(|k| (b[k] - a[k]) / interval);
    let velocity: Vec<[f64; 2]> = before.iter().zip(&after).map(rate).collect();
    let position = vectors(index);
    let largest = |k: usize| position.iter().map(|x| x[k]).fold(f64::MIN, f64::max);
    let energy = velocity.iter().map(|v| 0.5 * (v[0] * v[0] + v[1] * v[1])).sum();
    Frame {
        time: index as f64 * interval,
        budget: BTreeMap::from([
            ("front".to_owned(), largest(0)),
            ("max_height".to_owned(), largest(1)),
            ("kinetic_energy".to_owned(), energy),
        ]),
        boxes: bodies.boxes().iter().map(|body| body.at(index)).collect(),
        position,
        velocity,
        ..Frame::default()
    }
}

/// Median distance (m) of a particle to its nearest neighbour.
fn neighbour_distance(positions: ArrayView2<f64>) -> f64 {
    let mut points: Vec<[f64; 2]> = positions.rows().into_iter().map(|x| [x[0], x[1]]).collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let nearest = |index: usize| {
        let [x, y] = points[index];
        let mut least = f64::INFINITY;
        let distances = |other: &[f64; 2]| (other[0] - x, other[1] - y);
        // Those to the right and to the left, as far as they can be nearer.
        for (dx, dy) in points[index + 1..].iter().map(distances) {
            if dx > least {
                break;
            }
            least = least.min(dx.hypot(dy));
        }
        for (dx, dy) in points[..index].iter().rev().map(distances) {
            if -dx > least {
                break;
            }
            least = least.min(dx.hypot(dy));
        }
        least
    };
    let mut all: Vec<f64> = (0..points.len()).map(nearest).filter(|&d| d > 0.0).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
}
