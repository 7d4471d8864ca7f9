//! Training batches on the device: from positions to graphs and features.

use std::sync::Arc;

use cudarc::driver::{CudaEvent, CudaSlice, CudaView, CudaViewMut};
use gpu::Device;

use super::error::CudaError;
use super::frame_builder::{FrameBuilder, NewFrame};
use super::graph_builder::starts;
use super::ops::frame_input::FrameInput;
use super::pushforward::PushedWindows;
use super::support::Capacity;
use crate::data::{Batch, Unrolling};
use crate::features::{Normalisation, Obstacle};
use crate::network::{ModelConfig, ModelKind};

/// Edges of each point that there is memory for at first; it grows as needed.
pub const EDGES_PER_POINT: usize = 48;

/// Places of batches, which are made in turn, so that one is made while another is read.
pub(super) const PLACES: usize = 2;

/// Most frames that are predicted from a whole window each. More take less time one after the other,
/// although the window has to be gone through frame by frame first.
const WHOLE_WINDOWS: usize = 2;

/// Makes batches on a stream of its own.
pub struct BatchBuilder {
    device: Arc<Device>,
    /// The GPU with the stream on which batches are read.
    reader: Arc<Device>,
    config: ModelConfig,
    norm: Normalisation,
    bounds: Vec<[f64; 2]>,
    /// Most points of each window so far, and edges to have memory for.
    largest: Vec<usize>,
    edges: usize,
    places: [Option<Place>; PLACES],
    /// When what was in a place has been read.
    read: [CudaEvent; PLACES],
    /// When windows are there to be moved on, and when the network has predicted where to.
    ready: CudaEvent,
    predicted: CudaEvent,
    /// The place of the next batch.
    next: usize,
}

/// A batch and what it is made with.
struct Place {
    builder: FrameBuilder,
    /// Frames of a window x points x dimensions (m).
    positions: CudaSlice<f32>,
    pushed: PushedWindows,
    batch: DeviceBatch,
}

/// What a network learns from in one step.
pub struct DeviceBatch {
    /// The frames that the network has graphs of, the oldest first.
    pub frames: Vec<FrameInput>,
    /// Normalised accelerations (points x dimensions), at the start of the list,
    pub targets: CudaSlice<f32>,
    /// and the number of these values.
    pub values: usize,
    /// Number of points up to the end of each window, at the start of the list,
    pub window_ends: CudaSlice<u32>,
    /// and the number of windows.
    pub windows: usize,
}

impl DeviceBatch {
    /// The capacity that a network needs for batches in this one's place.
    pub fn capacity(&self) -> Capacity {
        let graph = &self.frames[0].graph;
        Capacity { points: graph.points, edges: graph.capacity }
    }
}

/// What the network predicts from.
pub enum PredictionInput<'a> {
    /// Windows.
    Windows {
        /// Their frames, the oldest first.
        frames: &'a [FrameInput],
        /// Whether windows follow that go on with a frame ([`Next`](Self::Next)).
        followed: bool,
    },
    /// The windows of the prediction before, moved on by a frame.
    Next {
        /// That frame,
        frame: &'a FrameInput,
        /// and the one before it.
        before: &'a FrameInput,
    },
}

/// The windows of a batch side by side.
#[derive(Clone, Debug)]
pub struct HostWindows {
    /// Points of each window.
    pub points: Vec<usize>,
    /// Positions (m) of the points of all windows, frame after frame, the oldest first.
    pub positions: Vec<f32>,
    /// Features that never change, of the points of all windows.
    pub statics: Vec<f32>,
    /// Obstacles of each window.
    pub obstacles: Vec<Vec<Obstacle>>,
    /// Normalised accelerations of the points of all windows.
    pub targets: Vec<f32>,
    /// How the network moves the windows on before it learns.
    pub unrolling: Option<Unrolling>,
}

impl HostWindows {
    /// Puts the windows of a batch, at least one, side by side, as they are or with what it takes to
    /// move them on.
    pub fn new(batch: Batch, unrolling: Option<Unrolling>) -> Self {
        let Batch { windows, points, statics, obstacles, targets } = batch;
        let dimensions = targets.len() / points.iter().sum::<usize>().max(1);
        let strides: Vec<usize> = points.iter().map(|points| points * dimensions).collect();
        let frames = windows[0].len() / strides[0].max(1);
        let mut positions = Vec::with_capacity(windows.iter().map(Vec::len).sum());
        for frame in 0..frames {
            for (window, &stride) in windows.iter().zip(&strides) {
                positions.extend_from_slice(&window[frame * stride..(frame + 1) * stride]);
            }
        }
        Self { points, positions, statics: statics.concat(), obstacles, targets, unrolling }
    }
}

impl BatchBuilder {
    /// For a `reader` of batches, with its stream. `bounds` are the lower and upper wall
    /// of each direction (m).
    ///
    /// # Errors
    /// A failure of the GPU.
    pub fn new(
        reader: &Arc<Device>,
        config: &ModelConfig,
        norm: &Normalisation,
        bounds: &[[f64; 2]],
    ) -> Result<Self, CudaError> {
        let event = || reader.context().new_event(None);
        Ok(Self {
            device: reader.with_urgent_stream()?,
            reader: reader.clone(),
            config: config.clone(),
            norm: norm.clone(),
            bounds: bounds.to_vec(),
            largest: Vec::new(),
            edges: 0,
            places: [None, None],
            read: [event()?, event()?],
            ready: event()?,
            predicted: event()?,
            next: 0,
        })
    }

    /// Makes the batch of some windows, of at least one point and with the frames of the network, while
    /// what is queued on the reader's stream goes on. Waits until it is made. It stays until after the
    /// next one.
    ///
    /// Windows that are to be moved on are so by what `predict` queues on the reader's stream:
    /// normalised accelerations, points x dimensions.
    ///
    /// # Errors
    /// A network that is too large for the kernels, too little memory, no compiler, or a kernel
    /// failed; those of `predict`.
    pub fn make(
        &mut self,
        host: &HostWindows,
        mut predict: impl FnMut(PredictionInput, &mut CudaViewMut<f32>) -> Result<(), CudaError>,
    ) -> Result<&DeviceBatch, CudaError> {
        let now = self.next;
        self.next = (now + 1) % PLACES;
        // What reads the batch before is queued by now.
        self.read[self.next].record(self.reader.stream())?;
        let stream = self.device.stream().clone();
        stream.wait(&self.read[now])?;
        self.grow(&host.points);
        let mut place = match self.places[now].take() {
            Some(place) if place.builder.fits(&host.points) => place,
            _ => self.place()?,
        };
        loop {
            stream.memcpy_htod(&host.positions, &mut place.positions)?;
            stream.memcpy_htod(&host.targets, &mut place.batch.targets)?;
            place.batch.values = host.targets.len();
            let starts = starts(host.points.iter().copied());
            stream.memcpy_htod(&starts[1..], &mut place.batch.window_ends)?;
            place.batch.windows = host.points.len();
            place.builder.set_windows(&host.points)?;
            place.builder.set_statics(&host.statics)?;
            place.builder.set_obstacles(&host.obstacles)?;
            self.make_frames(&mut place)?;
            if let Some(unrolling) = &host.unrolling {
                self.push_forward(&mut place, unrolling, &mut predict)?;
            }
            let needed = place.builder.needed()?;
            if needed <= place.batch.frames[0].graph.capacity {
                break;
            }
            self.edges = needed + needed / 4;
            place = self.place()?;
        }
        Ok(&self.places[now].insert(place).batch)
    }

    /// Queues the making of graphs and features of all frames from positions.
    fn make_frames(&self, place: &mut Place) -> Result<(), CudaError> {
        let Place { builder, positions, batch, .. } = place;
        let at = self.frames_of(positions, batch.values);
        let first = at.len() - batch.frames.len();
        let mut frames: Vec<_> = (first..)
            .zip(&mut batch.frames)
            .map(|(k, frame)| {
                let (known, back) = (self.known(k - first), at.len() - 1 - k);
                NewFrame { past: &at[..=k], known, back, frame }
            })
            .collect();
        builder.graphs(&mut frames)?;
        Ok(builder.features(&mut frames)?)
    }

    /// Queues the same for the newest frame, in the place of frame `number` of the batch.
    fn make_newest(&self, place: &mut Place, number: usize) -> Result<(), CudaError> {
        let Place { builder, positions, batch, .. } = place;
        let at = self.frames_of(positions, batch.values);
        // Not the first of its window.
        let (known, frame) = (self.known(1), &mut batch.frames[number]);
        let new = NewFrame { past: &at, known, back: 0, frame };
        let mut frames = [new];
        builder.graphs(&mut frames)?;
        Ok(builder.features(&mut frames)?)
    }

    fn frames_of<'a>(
        &self,
        positions: &'a CudaSlice<f32>,
        values: usize,
    ) -> Vec<CudaView<'a, f32>> {
        (0..self.config.window()).map(|k| positions.slice(k * values..(k + 1) * values)).collect()
    }

    /// Of the frame with this number among those with graphs, the frames whose velocities its nodes
    /// know: the newest.
    fn known(&self, number: usize) -> usize {
        match self.config.kind {
            ModelKind::Tgnns => (number + 1).min(2),
            ModelKind::Gns => self.config.frames,
        }
    }

    /// Queues the moving of windows.
    fn push_forward(
        &self,
        place: &mut Place,
        unrolling: &Unrolling,
        predict: &mut impl FnMut(PredictionInput, &mut CudaViewMut<f32>) -> Result<(), CudaError>,
    ) -> Result<(), CudaError> {
        let (stream, reader) = (self.device.stream(), self.reader.stream());
        place.pushed.begin(unrolling)?;
        let followed = unrolling.steps > WHOLE_WINDOWS;
        for step in 1..=unrolling.steps {
            self.ready.record(stream)?;
            reader.wait(&self.ready)?;
            let Place { builder, positions, pushed, batch } = &mut *place;
            // New frames take the places of the oldest.
            let count = batch.frames.len();
            let [frame, before] = [step + count - 2, step + 2 * count - 3].map(|k| k % count);
            let [frame, before] = [&batch.frames[frame], &batch.frames[before]];
            let input = if step == 1 || !followed {
                PredictionInput::Windows { frames: &batch.frames, followed }
            } else {
                PredictionInput::Next { frame, before }
            };
            predict(input, &mut pushed.predicted.slice_mut(..batch.values))?;
            self.predicted.record(reader)?;
            stream.wait(&self.predicted)?;
            let size = [self.config.window(), batch.values];
            let last = step == unrolling.steps;
            let targets = Some(&mut batch.targets).filter(|_| last);
            pushed.step(builder.window(), positions, size, targets)?;
            builder.next_frame()?;
            if last || !followed {
                self.make_frames(place)?;
            } else {
                self.make_newest(place, (step - 1) % count)?;
            }
        }
        Ok(())
    }

    /// Has new places have memory for such windows.
    fn grow(&mut self, points: &[usize]) {
        self.largest.resize(self.largest.len().max(points.len()), 0);
        for (largest, &points) in self.largest.iter_mut().zip(points) {
            *largest = points.max(*largest);
        }
        self.edges = self.edges.max(EDGES_PER_POINT * self.largest.iter().sum::<usize>());
    }

    /// Memory for another batch.
    fn place(&self) -> Result<Place, CudaError> {
        let Self { device, config, norm, bounds, largest, .. } = self;
        let graphs = config.graphs();
        let builder = FrameBuilder::new(device, config, norm, bounds, largest, graphs)?;
        let values = builder.points() * config.dimensions;
        let frames = (0..graphs).map(|_| builder.allocate(self.edges));
        Ok(Place {
            positions: device.zeros(config.window() * values)?,
            pushed: PushedWindows::new(device, largest.len(), values)?,
            batch: DeviceBatch {
                frames: frames.collect::<Result<_, _>>()?,
                targets: device.zeros(values)?,
                values: 0,
                window_ends: device.zeros(largest.len())?,
                windows: 0,
            },
            builder,
        })
    }
}

impl Drop for BatchBuilder {
    /// Waits for what reads the batches, whose memory goes.
    fn drop(&mut self) {
        let _ = self.reader.stream().synchronize();
    }
}
