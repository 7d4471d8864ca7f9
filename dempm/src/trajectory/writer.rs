//! Writes a trajectory that can be interrupted at any moment.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fs;
use std::path::{Path, PathBuf};

use files::{AtomicFile, WriteError, write_atomically};
use hdf5::file::{FileAccessBuilder, LibraryVersion};
use hdf5::sync::sync;
use hdf5::{File, H5Type};
use rayon::prelude::*;

use super::attributes::{remove, write_scalar};
use super::chunk::{Chunk, Values};
use super::error::{Result, TrajectoryError};
use super::frame::{Frame, FrameShape, Points};
use super::grain_datasets;
use super::grains::StaticGrains;
use super::grid::StaticGrid;
use super::grid_datasets;
use super::header::Header;
use super::header_limits::implausible;
use super::layout::{
    BOXES, BUDGET, COLUMN, Field, MASS, REST_TIME, TIME, WALL_TIME, WALLS, WARNINGS, unlocked,
};
use super::links::{self, new_group};
use super::meaning;
use super::reader::Trajectory;
use super::storage::{create_growing, set_frames, write_frames, write_whole};
use super::texts::write_text;
use super::vtk;
use super::vtk_layout;
use super::write_through::WriteThrough;

/// Appends frames to a trajectory file.
///
/// Frames stay in memory until [`commit`](Self::commit) writes them to a copy of the file and gives it
/// the name of the old one: readers find whole frames at any moment. The disk therefore needs room for
/// the file twice. [`draft`](Self::draft) does most of the work ahead of the commit.
///
/// HDF5 has one lock for the whole program. It is held over all calls that belong together: threads that write many
/// files would otherwise spend their time waiting for it, call by call.
#[derive(Debug)]
pub struct TrajectoryWriter {
    path: PathBuf,
    points: usize,
    /// Frames from one with grains to the next, and the number of grains.
    grains: Option<(usize, usize)>,
    /// Nodes of the grid.
    nodes: Option<usize>,
    /// Frames of the file on the disk that the next commit keeps.
    kept: usize,
    pending: Vec<Frame>,
    /// The file that the next commit will publish.
    drafted: Option<Drafted>,
    shape: Option<FrameShape>,
    wall_time: BTreeMap<String, f64>,
    status: String,
    /// Warnings of the run, one a line; unknown if another program makes the file.
    warnings: Option<String>,
    /// From when on frames repeat a state at rest (s).
    rest_time: Option<f64>,
}

/// A copy of the file, to which frames are added.
#[derive(Debug)]
struct Drafted {
    file: WriteThrough,
    draft: AtomicFile,
    /// Pending frames whose values at points it holds.
    frames: usize,
}

impl TrajectoryWriter {
    /// Creates a trajectory without frames, replacing any file at `path`.
    ///
    /// # Errors
    /// If there are no points, their arrays differ in length, or the file cannot be written.
    pub fn create(path: &Path, header: &Header, points: &Points) -> Result<Self> {
        Self::create_with(path, header, points, None, None)
    }

    /// As [`create`](Self::create), with grains in every [`StaticGrains::every`]-th frame, and fields on a
    /// grid.
    ///
    /// # Errors
    /// As [`create`](Self::create).
    pub fn create_with(
        path: &Path,
        header: &Header,
        points: &Points,
        grains: Option<&StaticGrains>,
        grid: Option<&StaticGrid>,
    ) -> Result<Self> {
        let writer = Self {
            path: path.to_owned(),
            points: points.mass.len(),
            grains: grains.map(|grains| (grains.every.max(1), grains.radius.len())),
            nodes: grid.map(|grid| grid.x.len() * grid.y.len()),
            kept: 0,
            pending: Vec::new(),
            drafted: None,
            shape: None,
            wall_time: BTreeMap::new(),
            status: "running".to_owned(),
            warnings: None,
            rest_time: None,
        };
        if points.mass.is_empty() || points.column.len() != points.mass.len() {
            return Err(writer.mismatch(format!(
                "{} masses and {} columns; a trajectory needs one of each a point",
                points.mass.len(),
                points.column.len()
            )));
        }
        // Nobody could open it.
        if let Some((item, problem)) = implausible(header) {
            let (path, item) = (path.to_owned(), item.to_owned());
            return Err(TrajectoryError::Value { path, item, problem });
        }
        write_atomically(path, |temporary| {
            let file = WriteThrough::create(temporary, version_110)
                .map_err(TrajectoryError::writing(path, "the file"))?;
            sync(|| {
                writer
                    .write_static(&file, header, points)
                    .and_then(|()| grains.map_or(Ok(()), |g| grain_datasets::create(&file, g)))
                    .and_then(|()| grid.map_or(Ok(()), |g| grid_datasets::create(&file, g)))
                    .map_err(TrajectoryError::writing(path, "the file"))?;
                writer.update(&file)?;
                file.close().map_err(TrajectoryError::writing(path, "the file"))
            })
        })?;
        Ok(writer)
    }

    /// Continues the trajectory at `path` after its first `frames_to_keep` frames.
    ///
    /// Later frames, recorded after the checkpoint of the resumed run, are removed by the next commit.
    ///
    /// # Errors
    /// If the file is not a trajectory or has fewer frames.
    pub fn resume(path: &Path, frames_to_keep: usize) -> Result<Self> {
        let trajectory = Trajectory::open(path)?;
        if frames_to_keep > trajectory.frames() {
            return Err(TrajectoryError::NoSuchFrame {
                path: path.to_owned(),
                frame: frames_to_keep - 1,
                frames: trajectory.frames(),
            });
        }
        let shape = match frames_to_keep {
            0 => None,
            _ => Some(trajectory.frame(0)?.shape()),
        };
        Ok(Self {
            path: path.to_owned(),
            points: trajectory.points().mass.len(),
            grains: trajectory.grain_interval().zip(trajectory.grain_count()),
            nodes: trajectory.grid().map(|grid| grid.x.len() * grid.y.len()),
            kept: frames_to_keep,
            pending: Vec::new(),
            drafted: None,
            shape,
            wall_time: trajectory.wall_time().clone(),
            status: "running".to_owned(),
            warnings: None,
            rest_time: None,
        })
    }

    /// The number of frames on the disk and pending.
    pub fn frames(&self) -> usize {
        self.kept + self.pending.len()
    }

    /// Adds a pending frame.
    ///
    /// # Errors
    /// If its arrays do not have one entry a point, or it differs in its fields, boxes or scalars
    /// from the frames before it.
    pub fn push(&mut self, frame: Frame) -> Result<()> {
        let lengths = [
            ("position", Some(frame.position.len())),
            ("velocity", Some(frame.velocity.len())),
            ("stress", frame.stress.as_ref().map(Vec::len)),
            ("solid_fraction", frame.solid_fraction.as_ref().map(Vec::len)),
            ("coordination", frame.coordination.as_ref().map(Vec::len)),
            ("inertial_number", frame.inertial_number.as_ref().map(Vec::len)),
        ];
        for (name, length) in lengths {
            if let Some(length) = length
                && length != self.points
            {
                return Err(self.mismatch(format!(
                    "{name} has {length} entries, but there are {} points",
                    self.points
                )));
            }
        }
        let shape = frame.shape();
        if let Some(expected) = &self.shape {
            if let Some(difference) = expected.difference(&shape) {
                return Err(self.mismatch(difference));
            }
        } else {
            self.shape = Some(shape);
        }
        let grains = frame.grains.as_ref();
        if let Some(reason) = grain_datasets::mismatch(self.grains, self.frames(), grains) {
            return Err(self.mismatch(reason));
        }
        if let Some(reason) = grid_datasets::mismatch(self.nodes, frame.grid.as_ref()) {
            return Err(self.mismatch(reason));
        }
        self.pending.push(frame);
        Ok(())
    }

    /// Sets the wall time spent so far in a phase of the run, s; written at the next commit.
    pub fn set_wall_time(&mut self, phase: &str, seconds: f64) {
        self.wall_time.insert(phase.to_owned(), seconds);
    }

    /// Sets the warnings of the run, one a line; written at the next commit.
    pub fn set_warnings(&mut self, warnings: String) {
        self.warnings = Some(warnings);
    }

    /// Sets the time from which on frames repeat a state at rest, s; written at the next commit.
    pub fn set_rest_time(&mut self, time: f64) {
        self.rest_time = Some(time);
    }

    /// The wall time per phase, s; after a resume, that of the file.
    pub fn wall_time(&self) -> &BTreeMap<String, f64> {
        &self.wall_time
    }

    /// Writes the values at points of the pending frames into the file that the next
    /// [`commit`](Self::commit) publishes; before that, they are not safe.
    ///
    /// # Errors
    /// If the file cannot be written. The commit then starts from scratch.
    pub fn draft(&mut self) -> Result<()> {
        let mut drafted = match self.drafted.take() {
            Some(drafted) => drafted,
            None => self.begin_draft()?,
        };
        self.append(&drafted.file, drafted.frames)?;
        drafted.frames = self.pending.len();
        self.drafted = Some(drafted);
        Ok(())
    }

    /// Writes all pending frames to the disk. When this returns, they are safe.
    ///
    /// # Errors
    /// If the file cannot be written. The file on the disk is then unchanged, the frames are still
    /// pending, and the commit can be repeated.
    pub fn commit(&mut self) -> Result<()> {
        self.draft()?;
        if let Some(Drafted { file, draft, .. }) = self.drafted.take() {
            sync(|| {
                self.append_scalars(&file)?;
                self.update(&file)?;
                file.close().map_err(TrajectoryError::writing(&self.path, "the file"))
            })?;
            draft.publish()?;
        }
        self.kept = self.frames();
        self.pending.clear();
        Ok(())
    }

    /// Commits the last frames with the final status of the run: `finished`, or what stopped it.
    ///
    /// # Errors
    /// As [`commit`](Self::commit).
    pub fn finish(mut self, status: &str) -> Result<()> {
        status.clone_into(&mut self.status);
        self.commit()
    }

    /// Writes everything that never changes.
    fn write_static(&self, file: &File, header: &Header, points: &Points) -> hdf5::Result<()> {
        header.write(file)?;
        new_group(file, "points")?;
        new_group(file, "boundary")?;
        new_group(file, BUDGET)?;
        new_group(file, WALL_TIME)?;
        write_whole(file, MASS, &[self.points], &points.mass, meaning::MASS)?;
        write_whole(file, COLUMN, &[self.points], &points.column, meaning::COLUMN)?;
        write_whole(
            file,
            WALLS,
            &[header.walls.len(), 4],
            header.walls.as_flattened(),
            meaning::WALLS,
        )?;
        create_growing::<f64>(file, TIME, &[], meaning::TIME)?;
        for field in [Field::Position, Field::Velocity] {
            let inner = &field.shape(0, self.points)[1..];
            create_growing::<f64>(file, field.name(), inner, meaning::of_field(field))?;
        }
        Ok(())
    }

    /// A copy of the file, cut to the frames to keep.
    fn begin_draft(&self) -> Result<Drafted> {
        let draft = AtomicFile::new(&self.path)?;
        fs::copy(&self.path, draft.temporary()).map_err(WriteError::at(&self.path, "copy it"))?;
        let file = WriteThrough::open(draft.temporary(), version_110)
            .map_err(TrajectoryError::writing(&self.path, "the file"))?;
        self.set_frames(&file, self.kept)?;
        Ok(Drafted { file, draft, frames: 0 })
    }

    /// Appends the values at points of the pending frames from number `first` on.
    fn append(&self, file: &File, first: usize) -> Result<()> {
        if first == self.pending.len() {
            return Ok(());
        }
        let frames = self.pending.iter().enumerate().skip(first);
        let values: Vec<Values<'_>> =
            frames.flat_map(|(index, frame)| self.values(self.kept + index, frame)).collect();
        let chunks: Vec<Chunk> = values.par_iter().filter_map(Values::pack).collect();
        sync(|| self.append_chunks(file, first, &chunks))
    }

    /// As [`append`](Self::append), with packed values.
    fn append_chunks(&self, file: &File, first: usize, chunks: &[Chunk]) -> Result<()> {
        if let Some(shape) = self.shape.as_ref().filter(|_| self.kept + first == 0) {
            self.create_chosen(file, shape)
                .map_err(TrajectoryError::writing(&self.path, "the file"))?;
        }
        self.set_frames(file, self.frames())?;
        let mut datasets = BTreeMap::new();
        for chunk in chunks {
            let mut write = || {
                let dataset = match datasets.entry(chunk.dataset) {
                    Entry::Occupied(dataset) => dataset.into_mut(),
                    Entry::Vacant(place) => place.insert(file.dataset(chunk.dataset)?),
                };
                chunk.write(dataset)
            };
            write().map_err(TrajectoryError::writing(&self.path, chunk.dataset))?;
        }
        Ok(())
    }

    /// Sets the length of all datasets that grow along the frames.
    fn set_frames(&self, file: &File, frames: usize) -> Result<()> {
        for_each_growing(file, |dataset, name| {
            set_frames(dataset, frames).map_err(TrajectoryError::writing(&self.path, name))
        })
        .map_err(TrajectoryError::writing(&self.path, "the file"))??;
        grain_datasets::set_length(file, frames)
            .map_err(TrajectoryError::writing(&self.path, grain_datasets::GROUP))?;
        grid_datasets::set_length(file, frames)
            .map_err(TrajectoryError::writing(&self.path, grid_datasets::GROUP))
    }

    /// Creates the datasets that depend on the first frame.
    fn create_chosen(&self, file: &File, shape: &FrameShape) -> hdf5::Result<()> {
        // A resume before the first frame may find those of an earlier attempt.
        for field in Field::OPTIONAL {
            if links::exists(file, field.name())? {
                file.unlink(field.name())?;
            }
            if shape.fields.contains(&field.name()) {
                let inner = &field.shape(0, self.points)[1..];
                create_growing::<f32>(file, field.name(), inner, meaning::of_field(field))?;
            }
        }
        if links::exists(file, BOXES)? {
            file.unlink(BOXES)?;
        }
        if shape.boxes > 0 {
            create_growing::<f64>(file, BOXES, &[shape.boxes, 4], meaning::BOXES)?;
        }
        file.unlink(BUDGET)?;
        let budget = new_group(file, BUDGET)?;
        for name in &shape.budget {
            create_growing::<f64>(&budget, name, &[], meaning::of_budget(name))?;
        }
        Ok(())
    }

    /// The values of frame number `index` at points, of grains and on the grid.
    fn values<'a>(&self, index: usize, frame: &'a Frame) -> Vec<Values<'a>> {
        let mut values = vec![
            Values::new(Field::Position.name(), index, frame.position.as_flattened()),
            Values::new(Field::Velocity.name(), index, frame.velocity.as_flattened()),
        ];
        if let Some(stress) = &frame.stress {
            values.push(Values::new(Field::Stress.name(), index, stress.as_flattened()));
        }
        let scalars = Field::OPTIONAL.into_iter();
        values.extend(
            scalars
                .filter_map(|field| Some(Values::new(field.name(), index, frame.scalar(field)?))),
        );
        if let (Some(grains), Some((every, _))) = (&frame.grains, self.grains) {
            values.extend(grain_datasets::values(index / every, grains));
        }
        if let Some(grid) = &frame.grid {
            values.extend(grid_datasets::values(index, grid));
        }
        values
    }

    /// Writes times, boxes and scalars of all pending frames at once: many frames share a chunk, which
    /// would otherwise be compressed again for each.
    fn append_scalars(&self, file: &File) -> Result<()> {
        let Some(first) = self.pending.first() else { return Ok(()) };
        let of_frames = |value: &dyn Fn(&Frame) -> f64| -> Vec<f64> {
            self.pending.iter().map(value).collect()
        };
        let put = |name: &str, values: &[f64]| {
            self.put(file, name, self.kept, self.pending.len(), values)
        };
        put(TIME, &of_frames(&|frame| frame.time))?;
        let boxes: Vec<[f64; 4]> = self.pending.iter().flat_map(|f| f.boxes.clone()).collect();
        if !boxes.is_empty() {
            put(BOXES, boxes.as_flattened())?;
        }
        for name in first.budget.keys() {
            put(&format!("{BUDGET}/{name}"), &of_frames(&|frame| frame.budget[name]))?;
        }
        Ok(())
    }

    /// Writes `count` frames of a dataset, from number `first` on.
    fn put<T: H5Type>(
        &self,
        file: &File,
        name: &str,
        first: usize,
        count: usize,
        values: &[T],
    ) -> Result<()> {
        file.dataset(name)
            .and_then(|dataset| write_frames(&dataset, first..first + count, values))
            .map_err(TrajectoryError::writing(&self.path, name))
    }

    /// Writes everything that depends on the number of frames or changes during the run.
    fn update(&self, file: &File) -> Result<()> {
        let put = || {
            write_text(file, "status", &self.status)?;
            if let Some(warnings) = &self.warnings {
                write_text(file, WARNINGS, warnings)?;
            }
            match self.rest_time {
                Some(time) => write_scalar(file, REST_TIME, &time)?,
                None => remove(file, REST_TIME)?,
            }
            let wall_time = file.group(WALL_TIME)?;
            for (phase, seconds) in &self.wall_time {
                write_scalar(&wall_time, phase, seconds)?;
            }
            Ok(())
        };
        put().map_err(TrajectoryError::writing(&self.path, WALL_TIME))?;
        vtk::write(file, self.frames(), self.points)
            .map_err(TrajectoryError::writing(&self.path, vtk_layout::ROOT))
    }

    fn mismatch(&self, reason: String) -> TrajectoryError {
        TrajectoryError::FrameMismatch { path: self.path.clone(), frame: self.frames(), reason }
    }
}

/// The format of HDF5 1.10, the first with virtual datasets. Its metadata carry checksums, which
/// earlier formats lack: a damaged file gives an error instead of nonsense.
fn version_110(access: &mut FileAccessBuilder) -> &mut FileAccessBuilder {
    unlocked(access).libver_bounds(LibraryVersion::V110, LibraryVersion::V110)
}

/// Calls `act` for every dataset that grows along the frames, until it fails.
fn for_each_growing<E>(
    file: &File,
    mut act: impl FnMut(&hdf5::Dataset, &str) -> std::result::Result<(), E>,
) -> hdf5::Result<std::result::Result<(), E>> {
    let mut names: Vec<String> = vec![TIME.to_owned(), BOXES.to_owned()];
    names.extend(Field::ALL.iter().map(|field| field.name().to_owned()));
    for name in file.group(BUDGET)?.member_names()? {
        names.push(format!("{BUDGET}/{name}"));
    }
    for name in &names {
        if links::exists(file, name)?
            && let Err(error) = act(&file.dataset(name)?, name)
        {
            return Ok(Err(error));
        }
    }
    Ok(Ok(()))
}
