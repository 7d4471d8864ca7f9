//! Training steps on a GPU: loss, gradient and optimiser, queued as one CUDA graph.

use std::collections::VecDeque;
use std::sync::Arc;

use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use cudarc::driver::{CudaGraph, CudaSlice, CudaViewMut};
use gpu::ranks::Ranks;
use gpu::{ConstPointer, Device, Pointer};

use super::batch::{PLACES, PredictionInput};
use super::error::CudaError;
use super::network::{CudaNetwork, FrameView};
use super::ops::frame_input::FrameInput;
use super::ops::muon::{Muon, MuonStep};
use super::ops::optimiser::{Adam, Loss};
use super::support::Capacity;
use super::weight_gradient::{Products, WeightGradient};
use crate::network::parameters::HiddenMatrix;
use crate::network::{ModelConfig, Precision};

/// Most losses that the device keeps until they are read.
pub const LOSSES: usize = 4096;
/// Keeps the loss finite when nothing accelerates.
const SMALLEST_TARGET: f32 = 1e-12;

/// A network in training.
pub struct CudaTrainer {
    network: CudaNetwork,
    /// The same without memory for gradients, once something is to be predicted.
    predictor: Option<CudaNetwork>,
    gradient: WeightGradient,
    /// Added in squares to the squared targets of the loss.
    floor: f32,
    /// Makes the loss the mean of those of all groups.
    relative: bool,
    /// Other GPUs, whose gradients are added to that of this one.
    ranks: Option<Arc<Ranks>>,
    /// Moving averages of the gradient and of its square.
    mean: CudaSlice<f32>,
    square: CudaSlice<f32>,
    /// Moving average of the weights.
    average: Option<CudaSlice<f32>>,
    /// Updates hidden matrices in place of Adam.
    muon: Option<Muon>,
    /// Learning rate, the averages' corrections, decay of the average of the weights.
    rates: CudaSlice<f32>,
    /// The last [`LOSSES`] losses in turn, and the number of steps.
    losses: CudaSlice<f32>,
    counter: CudaSlice<u32>,
    /// The steps that can be repeated, the oldest first.
    captured: VecDeque<CapturedStep>,
}

/// A step on certain buffers, however large the batch is that they hold.
struct CapturedStep {
    views: Vec<FrameView>,
    targets: TargetView,
    /// Read by the graph.
    _products: Products,
    graph: CudaGraph,
}

/// What a step learns.
#[derive(Clone, Copy, Debug)]
pub struct Targets<'a> {
    /// Normalised accelerations (points x dimensions), at the start of the list.
    pub accelerations: &'a CudaSlice<f32>,
    /// Number of nodes up to the end of each group with a loss of its own ([`CudaTrainer::with_loss`]),
    pub ends: &'a CudaSlice<u32>,
    /// and the number of groups, at least one.
    pub groups: usize,
}

impl<'a> Targets<'a> {
    /// One group: all nodes of these frames.
    pub fn of_all(accelerations: &'a CudaSlice<f32>, frames: &'a [FrameInput]) -> Self {
        Self { accelerations, ends: &frames[0].graph.nodes, groups: 1 }
    }
}

/// The same for kernels.
#[derive(Clone, Copy, PartialEq)]
struct TargetView {
    accelerations: ConstPointer<f32>,
    ends: ConstPointer<u32>,
    groups: i32,
}

/// Numbers that change from step to step.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    /// Learning rate.
    pub rate: f32,
    /// 1 - beta^n of the averages of the gradient and of its square.
    pub corrections: [f32; 2],
    /// Decay of the average of the weights.
    pub decay: f32,
}

impl CudaTrainer {
    /// A network with weights all zero and an optimiser without memory. `averaging`: with a moving
    /// average of the weights. `ranks`: steps are made together with other GPUs, each on a batch of
    /// its own.
    ///
    /// # Errors
    /// As [`CudaNetwork::new`].
    pub fn new(
        device: &Arc<Device>,
        config: &ModelConfig,
        precision: Precision,
        capacity: Capacity,
        averaging: bool,
        ranks: Option<Arc<Ranks>>,
    ) -> Result<Self, CudaError> {
        let network = CudaNetwork::new(device, config, precision, capacity, true)?;
        let count = network.layout.parameters;
        Ok(Self {
            predictor: None,
            gradient: WeightGradient::new(&network)?,
            floor: 0.0,
            relative: false,
            ranks,
            mean: device.zeros(count)?,
            square: device.zeros(count)?,
            average: if averaging { Some(device.zeros(count)?) } else { None },
            muon: None,
            rates: device.zeros(4)?,
            losses: device.zeros(LOSSES)?,
            counter: device.zeros(1)?,
            captured: VecDeque::new(),
            network,
        })
    }

    /// The loss from here on: sum (a - a*)² / sum (a*² + `floor`²) over the nodes of all GPUs, or, if
    /// `relative`, the mean of what all groups of [`Targets`] of all GPUs have over their own nodes.
    #[must_use]
    pub fn with_loss(self, floor: f32, relative: bool) -> Self {
        Self { floor, relative, ..self }
    }

    /// From here on Muon updates these matrices of the weights, Adam all others.
    ///
    /// # Errors
    /// If the GPU has too little shared memory for Muon.
    pub fn set_muon(&mut self, matrices: &[HiddenMatrix]) -> Result<(), CudaError> {
        self.captured.clear();
        self.muon = None;
        if !matrices.is_empty() {
            let CudaNetwork { kernels, layout, .. } = &self.network;
            self.muon = Some(Muon::load(&kernels.launcher, matrices, layout.parameters)?);
        }
        Ok(())
    }

    /// The network in training.
    pub fn network(&mut self) -> &mut CudaNetwork {
        &mut self.network
    }

    fn device(&self) -> Arc<Device> {
        self.network.device().clone()
    }

    /// Grows to this capacity, if need be.
    ///
    /// # Errors
    /// If the GPU's memory is too small.
    pub fn grow(&mut self, capacity: Capacity) -> Result<(), CudaError> {
        let before = self.network.capacity();
        self.network.grow(capacity)?;
        if self.network.capacity() != before {
            self.device().stream().synchronize()?;
            self.captured.clear();
            self.gradient = WeightGradient::new(&self.network)?;
        }
        Ok(())
    }

    /// Queues the prediction of the normalised accelerations of windows (points x dimensions). Windows
    /// that go on with a frame are those of the call before.
    ///
    /// # Errors
    /// If the GPU's memory is too small.
    pub fn predict_windows(
        &mut self,
        input: PredictionInput,
        predicted: &mut CudaViewMut<f32>,
    ) -> Result<(), CudaError> {
        use PredictionInput::{Next, Windows};
        let stream = self.device().stream().clone();
        let output = match (input, &mut self.predictor) {
            (Next { frame, before }, Some(predictor)) => predictor.advance(frame, before)?,
            (Next { frame, .. }, None) => {
                let (what, found) = ("frames", frame.graph.points);
                return Err(CudaError::Capacity { what, found, room: 0 });
            }
            (Windows { frames, followed: true }, _) => self.predictor(frames)?.begin(frames)?,
            (Windows { frames, followed: false }, _) => self.predict(frames)?,
        };
        Ok(stream.memcpy_dtod(&output.slice(..predicted.len()), predicted)?)
    }

    /// The network as it is by now, with memory for the frames of windows.
    fn predictor(&mut self, frames: &[FrameInput]) -> Result<&mut CudaNetwork, CudaError> {
        let graph = &frames[0].graph;
        let room = Capacity { points: graph.points, edges: graph.capacity };
        let mut predictor = match self.predictor.take() {
            Some(predictor) => predictor,
            None => {
                let Self { network, .. } = self;
                let precision = network.kernels.launcher.precision;
                CudaNetwork::new(network.device(), &network.config, precision, room, false)?
            }
        };
        predictor.grow(room)?;
        predictor.copy_weights(&self.network)?;
        Ok(self.predictor.insert(predictor))
    }

    /// Predicts the normalised accelerations of a window or a batch of windows, the oldest frame first
    /// (points x dimensions, at the start of the list). Does not wait.
    ///
    /// # Errors
    /// If the GPU's memory is too small.
    pub fn predict(&mut self, frames: &[FrameInput]) -> Result<&CudaSlice<f32>, CudaError> {
        self.predictor(frames)?.forward(frames)
    }

    /// One step on a batch of windows. Does not wait.
    ///
    /// # Errors
    /// If there are more points or edges than there is memory for.
    pub fn step(
        &mut self,
        frames: &[FrameInput],
        targets: Targets,
        rates: Rates,
    ) -> Result<(), CudaError> {
        let Rates { rate, corrections: [mean, square], decay } = rates;
        let stream = self.device().stream().clone();
        stream.memcpy_htod(&[rate, mean, square, decay], &mut self.rates)?;
        let views = self.network.views(frames)?;
        let targets = self.target_view(targets);
        let same = |step: &&CapturedStep| step.views == views && step.targets == targets;
        match self.captured.iter().find(same) {
            Some(step) => step.graph.launch()?,
            None => self.capture(views, targets)?,
        }
        if let Some(ranks) = &self.ranks {
            ranks.all_reduce(&mut self.gradient.gradient)?;
            self.queue_update()?;
        }
        Ok(())
    }

    fn target_view(&self, Targets { accelerations, ends, groups }: Targets) -> TargetView {
        TargetView {
            accelerations: self.network.pointer(accelerations),
            ends: ConstPointer::to(ends, self.network.device().stream()),
            groups: groups as i32,
        }
    }

    /// Captures a step in a CUDA graph and queues it.
    fn capture(&mut self, views: Vec<FrameView>, targets: TargetView) -> Result<(), CudaError> {
        let stream = self.device().stream().clone();
        let products = self.gradient.products(&self.network, &views)?;
        // What is captured must not wait for what was queued before.
        stream.synchronize()?;
        stream.begin_capture(CUstreamCaptureMode::CU_STREAM_CAPTURE_MODE_THREAD_LOCAL)?;
        let captured = self.queue_captured(&views, targets, &products);
        let graph = stream.end_capture(CUgraphInstantiate_flags(0))?;
        captured?;
        let Some(graph) = graph else { return Ok(()) };
        graph.launch()?;
        if self.captured.len() == PLACES {
            self.captured.pop_front();
        }
        self.captured.push_back(CapturedStep { views, targets, _products: products, graph });
        Ok(())
    }

    /// What a CUDA graph repeats: the step, or the gradient where ranks add theirs. To capture that
    /// too, all would have to do so at the same time, but each has batches of its own.
    fn queue_captured(
        &self,
        views: &[FrameView],
        targets: TargetView,
        products: &Products,
    ) -> Result<(), CudaError> {
        self.queue_gradient(views, targets, products)?;
        if self.ranks.is_none() { self.queue_update() } else { Ok(()) }
    }

    /// Queues the optimiser's step with the gradient.
    fn queue_update(&self) -> Result<(), CudaError> {
        let network = &self.network;
        let stream = network.device().stream();
        let average = self.average.as_ref();
        let adam = Adam {
            weights: Pointer::to(&network.parameters, stream),
            mean: Pointer::to(&self.mean, stream),
            square: Pointer::to(&self.square, stream),
            average: average.map_or(Pointer::NULL, |average| Pointer::to(average, stream)),
            gradient: ConstPointer::to(&self.gradient.gradient, stream),
            rates: ConstPointer::to(&self.rates, stream),
            muon: self.muon.as_ref().map_or(ConstPointer::NULL, Muon::marks),
            count: network.layout.parameters as i32,
            losses: Pointer::to(&self.losses, stream),
            counter: Pointer::to(&self.counter, stream),
            ring: LOSSES as u32,
        };
        network.kernels.optimiser.adam(&adam)?;
        if let Some(muon) = &self.muon {
            let Adam { weights, mean, average, gradient, rates, count, .. } = adam;
            let matrices = muon.matrices();
            muon.step(&MuonStep { matrices, weights, mean, average, gradient, rates, count })?;
        }
        network.pack()
    }

    /// Queues the loss and its gradient.
    fn queue_gradient(
        &self,
        views: &[FrameView],
        targets: TargetView,
        products: &Products,
    ) -> Result<(), CudaError> {
        let network = &self.network;
        network.forward_pass(views, true)?;
        let Some(gradients) = &network.activations.gradients else { return Ok(()) };
        let all = Pointer::to(&self.gradient.gradient, network.device().stream());
        network.kernels.optimiser.loss_gradient(&Loss {
            output: network.pointer(&network.output),
            target: targets.accelerations,
            ends: targets.ends,
            groups: targets.groups,
            columns: network.layout.dimensions as i32,
            gradient: gradients.output,
            sums: all.offset(network.layout.parameters),
            floor: self.floor,
            relative: i32::from(self.relative),
        })?;
        let after_edges = || self.gradient.reduce_edges(network);
        network.backward_pass(views, gradients, products, after_edges)?;
        self.gradient.compute(network, products)
    }

    /// The loss and its gradient, in the order of the weights, which stay as they are. Other GPUs
    /// have no part in it.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn gradient(
        &mut self,
        frames: &[FrameInput],
        targets: Targets,
    ) -> Result<(f32, Vec<f32>), CudaError> {
        let views = self.network.views(frames)?;
        let products = self.gradient.products(&self.network, &views)?;
        self.queue_gradient(&views, self.target_view(targets), &products)?;
        let mut list = self.device().stream().clone_dtoh(&self.gradient.gradient)?;
        let sums = list.split_off(self.network.layout.parameters);
        let scale = sums[1].max(SMALLEST_TARGET);
        list.iter_mut().for_each(|sum| *sum /= scale);
        Ok((sums[0] / scale, list))
    }

    /// Times of the kernels of a step without the optimiser: name, launches, ms. Waits.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn profile(
        &mut self,
        frames: &[FrameInput],
        targets: Targets,
    ) -> Result<Vec<(&'static str, usize, f32)>, CudaError> {
        let views = self.network.views(frames)?;
        let products = self.gradient.products(&self.network, &views)?;
        let targets = self.target_view(targets);
        self.network.profile(|network| {
            network.pack()?;
            self.queue_gradient(&views, targets, &products)
        })
    }

    /// The last `count` losses (at most [`LOSSES`]), the oldest first. Waits.
    ///
    /// # Errors
    /// If a kernel failed.
    pub fn losses(&self, count: usize) -> Result<Vec<f32>, CudaError> {
        let stream = self.network.device().stream();
        let end = stream.clone_dtoh(&self.counter)?[0] as usize;
        let all = stream.clone_dtoh(&self.losses)?;
        let first = end.saturating_sub(count.min(LOSSES));
        Ok((first..end).map(|k| all[k % LOSSES]).collect())
    }

    /// Weights, averages of the gradient and of its square, and average of the weights. Waits.
    ///
    /// # Errors
    /// If a kernel failed.
    pub fn download(&self) -> Result<[Vec<f32>; 4], CudaError> {
        let stream = self.network.device().stream();
        let average = match &self.average {
            Some(average) => stream.clone_dtoh(average)?,
            None => Vec::new(),
        };
        let read = |list: &CudaSlice<f32>| stream.clone_dtoh(list);
        Ok([read(&self.network.parameters)?, read(&self.mean)?, read(&self.square)?, average])
    }

    /// Takes what [`download`](Self::download) gave.
    ///
    /// # Errors
    /// If a kernel failed, or the lists are not those of this network.
    pub fn restore(
        &mut self,
        weights: &[f32],
        [mean, square]: [&[f32]; 2],
        average: Option<&[f32]>,
    ) -> Result<(), CudaError> {
        let expected = self.network.layout.parameters;
        for list in [mean, square, average.unwrap_or(weights)] {
            if list.len() != expected {
                return Err(CudaError::Weights { found: list.len(), expected });
            }
        }
        let stream = self.device().stream().clone();
        stream.memcpy_htod(mean, &mut self.mean)?;
        stream.memcpy_htod(square, &mut self.square)?;
        if let (Some(to), Some(from)) = (&mut self.average, average) {
            stream.memcpy_htod(from, to)?;
        }
        self.network.set_weights(weights)
    }
}
