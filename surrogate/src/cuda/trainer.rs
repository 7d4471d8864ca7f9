//! Training steps on a GPU: loss, gradient and Adam, queued as one CUDA graph.

use std::collections::VecDeque;
use std::sync::Arc;

use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use cudarc::driver::{CudaGraph, CudaSlice, CudaViewMut};
use gpu::Device;
use gpu::ranks::Ranks;

use super::arguments::Address;
use super::batch::{PLACES, Seen};
use super::buffers::FrameInput;
use super::error::CudaError;
use super::kernels::Kernels;
use super::network::{Capacity, CudaNetwork, View};
use super::products::{List, Products};
use crate::network::{ModelConfig, Precision};

/// Losses that can wait on the device to be read.
pub const LOSSES: usize = 4096;
/// Numbers behind the gradient: the sums of squared errors and of squared targets, or of the losses of
/// GPUs and of ones; their ratio is the loss.
pub const SUMS: usize = 2;
/// Keeps the loss finite when nothing accelerates.
const SMALLEST_TARGET: f32 = 1e-12;

/// A network in training.
pub struct CudaTrainer {
    network: CudaNetwork,
    /// The same without room for gradients, once something is to be predicted.
    predictor: Option<CudaNetwork>,
    products: Products,
    /// Added in squares to the squared targets of the loss.
    floor: f32,
    /// Makes the loss of several GPUs the mean of theirs.
    each_relative: bool,
    /// Other GPUs, whose gradients are added to that of this one.
    ranks: Option<Arc<Ranks>>,
    /// Moving averages of the gradient and of its square.
    mean: CudaSlice<f32>,
    square: CudaSlice<f32>,
    /// Moving average of the weights.
    average: Option<CudaSlice<f32>>,
    /// Learning rate, the averages' corrections, decay of the average of the weights.
    rates: CudaSlice<f32>,
    losses: CudaSlice<f32>,
    counter: CudaSlice<u32>,
    /// The steps that can be repeated, the oldest first.
    queued: VecDeque<Queued>,
}

/// A step on what is at certain addresses, however large the batch is that is there.
struct Queued {
    views: Vec<View>,
    target: Address,
    /// Read by the graph.
    _list: List,
    graph: CudaGraph,
}

/// Numbers that change from step to step.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
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
            products: Products::new(&network, device)?,
            floor: 0.0,
            each_relative: false,
            ranks,
            mean: device.zeros(count)?,
            square: device.zeros(count)?,
            average: if averaging { Some(device.zeros(count)?) } else { None },
            rates: device.zeros(4)?,
            losses: device.zeros(LOSSES)?,
            counter: device.zeros(1)?,
            queued: VecDeque::new(),
            network,
        })
    }

    /// The loss from here on: sum (a - a*)² / sum (a*² + `floor`²) over the windows of all GPUs, or the
    /// mean of what `each` has over its own.
    #[must_use]
    pub fn with_loss(self, floor: f32, each: bool) -> Self {
        Self { floor, each_relative: each, ..self }
    }

    pub fn network(&mut self) -> &mut CudaNetwork {
        &mut self.network
    }

    fn device(&self) -> Arc<Device> {
        self.network.kernels.device.clone()
    }

    /// Makes room for larger batches, if need be.
    ///
    /// # Errors
    /// If the GPU's memory is too small.
    pub fn grow(&mut self, capacity: Capacity) -> Result<(), CudaError> {
        let before = self.network.capacity();
        self.network.grow(capacity)?;
        if self.network.capacity() != before {
            self.device().stream().synchronize()?;
            self.queued.clear();
            self.products = Products::new(&self.network, &self.device())?;
        }
        Ok(())
    }

    /// Queues what the network says of windows, normalised accelerations. Those that go on with a
    /// frame are the ones of the call before.
    ///
    /// # Errors
    /// If the GPU's memory is too small.
    pub fn say(&mut self, seen: Seen, said: &mut CudaViewMut<f32>) -> Result<(), CudaError> {
        let stream = self.device().stream().clone();
        let output = match (seen, &mut self.predictor) {
            (Seen::Next { frame, before }, Some(predictor)) => predictor.advance(frame, before)?,
            (Seen::Next { frame, .. }, None) => {
                return Err(CudaError::Room { what: "frames", found: frame.graph.points, room: 0 });
            }
            (Seen::Windows { frames, followed: true }, _) => {
                self.predictor(frames)?.begin(frames)?
            }
            (Seen::Windows { frames, followed: false }, _) => self.predict(frames)?,
        };
        Ok(stream.memcpy_dtod(&output.slice(..said.len()), said)?)
    }

    /// The network as it is by now, with room for the frames of windows.
    fn predictor(&mut self, frames: &[FrameInput]) -> Result<&mut CudaNetwork, CudaError> {
        let graph = &frames[0].graph;
        let room = Capacity { points: graph.points, edges: graph.capacity };
        let mut predictor = match self.predictor.take() {
            Some(predictor) => predictor,
            None => {
                let Kernels { device, precision, .. } = &self.network.kernels;
                CudaNetwork::new(device, &self.network.config, *precision, room, false)?
            }
        };
        predictor.grow(room)?;
        predictor.copy_weights(&self.network)?;
        Ok(self.predictor.insert(predictor))
    }

    /// What the network says of a window or a batch of windows, the oldest frame first: normalised
    /// accelerations, points x dimensions, at the start of the list. Does not wait.
    ///
    /// # Errors
    /// If the GPU's memory is too small.
    pub fn predict(&mut self, frames: &[FrameInput]) -> Result<&CudaSlice<f32>, CudaError> {
        self.predictor(frames)?.forward(frames)
    }

    /// One step on a batch of windows and its normalised accelerations (points x dimensions). Does
    /// not wait.
    ///
    /// # Errors
    /// If there are more points or edges than there is room for.
    pub fn step(
        &mut self,
        frames: &[FrameInput],
        target: &CudaSlice<f32>,
        rates: Rates,
    ) -> Result<(), CudaError> {
        let Rates { rate, corrections: [mean, square], decay } = rates;
        let stream = self.device().stream().clone();
        stream.memcpy_htod(&[rate, mean, square, decay], &mut self.rates)?;
        let views = self.network.views(frames)?;
        let target = self.network.address(target);
        let known = |queued: &Queued| queued.views == views && queued.target == target;
        match self.queued.iter().find(|queued| known(queued)) {
            Some(queued) => queued.graph.launch()?,
            None => self.queue(views, target)?,
        }
        if let Some(ranks) = &self.ranks {
            ranks.all_reduce(&mut self.products.gradient)?;
            self.queue_update()?;
        }
        Ok(())
    }

    /// Captures a step in a CUDA graph and queues it.
    fn queue(&mut self, views: Vec<View>, target: Address) -> Result<(), CudaError> {
        let stream = self.device().stream().clone();
        let list = self.products.list(&self.network, &views)?;
        // What is captured must not wait for what was queued before.
        stream.synchronize()?;
        stream.begin_capture(CUstreamCaptureMode::CU_STREAM_CAPTURE_MODE_THREAD_LOCAL)?;
        let captured = self.queue_captured(&views, target, &list);
        let graph = stream.end_capture(CUgraphInstantiate_flags(0))?;
        captured?;
        let Some(graph) = graph else { return Ok(()) };
        graph.launch()?;
        if self.queued.len() == PLACES {
            self.queued.pop_front();
        }
        self.queued.push_back(Queued { views, target, _list: list, graph });
        Ok(())
    }

    /// What a CUDA graph repeats: the step, or the gradient where ranks add theirs. To capture that
    /// too, all would have to do so at the same time, but each has batches of its own.
    fn queue_captured(
        &self,
        views: &[View],
        target: Address,
        list: &List,
    ) -> Result<(), CudaError> {
        self.queue_gradient(views, target, list)?;
        if self.ranks.is_none() { self.queue_update() } else { Ok(()) }
    }

    /// Queues Adam's step with the gradient.
    fn queue_update(&self) -> Result<(), CudaError> {
        let network = &self.network;
        let lists = [
            network.address(&network.parameters),
            network.address(&self.mean),
            network.address(&self.square),
            self.average.as_ref().map_or(0, |average| network.address(average)),
            network.address(&self.products.gradient),
            network.address(&self.rates),
        ];
        let ring = [network.address(&self.losses), network.address(&self.counter)];
        network.kernels.adam(lists, network.layout.parameters, ring, LOSSES)?;
        network.pack()
    }

    fn queue_gradient(
        &self,
        views: &[View],
        target: Address,
        list: &List,
    ) -> Result<(), CudaError> {
        let network = &self.network;
        network.pass(views, true)?;
        let Some(passed) = &network.room.training else { return Ok(()) };
        network.kernels.loss(
            [network.address(&network.output), target],
            views[0].nodes,
            network.layout.dimensions,
            [
                passed.output,
                network.address(&self.products.gradient) + 4 * network.layout.parameters as u64,
            ],
            self.floor,
            self.each_relative,
        )?;
        network.propagate(views, passed, list, || self.products.add_up_edges(network))?;
        self.products.launch(network, list)
    }

    /// The loss and its gradient, in the order of the weights, which stay as they are. Other GPUs
    /// have no part in it.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn gradient(
        &mut self,
        frames: &[FrameInput],
        target: &CudaSlice<f32>,
    ) -> Result<(f32, Vec<f32>), CudaError> {
        let views = self.network.views(frames)?;
        let products = self.products.list(&self.network, &views)?;
        self.queue_gradient(&views, self.network.address(target), &products)?;
        let mut list = self.device().stream().clone_dtoh(&self.products.gradient)?;
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
        target: &CudaSlice<f32>,
    ) -> Result<Vec<(&'static str, usize, f32)>, CudaError> {
        let views = self.network.views(frames)?;
        let products = self.products.list(&self.network, &views)?;
        self.network.profile(|network| {
            network.pack()?;
            self.queue_gradient(&views, network.address(target), &products)
        })
    }

    /// The last `count` losses (at most [`LOSSES`]), the oldest first. Waits.
    ///
    /// # Errors
    /// If a kernel failed.
    pub fn losses(&self, count: usize) -> Result<Vec<f32>, CudaError> {
        let stream = self.network.kernels.device.stream();
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
        let stream = self.network.kernels.device.stream();
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
