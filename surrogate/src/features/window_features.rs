//! Input features of a window, computed on the host in float32.
//!
//! Standardisation, unit directions and 0 for the distance to a far wall follow the paper; distances
//! to walls are divided by the connection radius, which the paper does not state. The GNS has the
//! features of Sanchez-Gonzalez et al. (2020): displacement / radius instead of the direction, and
//! distances to walls clipped to ±1 radius.

use burn::tensor::backend::Backend;
use rayon::prelude::*;

use super::graph::radius_graph;
use super::host_frame::HostFrame;
use super::input::WindowInput;
use super::node_features::{moving_features, standardised};
use super::normalisation::Normalisation;
use super::obstacle::Obstacle;
use super::window::Window;
use crate::network::{ModelConfig, ModelKind, feature_columns};

/// Depth, in connection radii, to which points inside an obstacle still see its face.
pub const SKIN: f32 = 1e-3;

/// Features and graphs of several windows as one batch. `bounds` are the lower and upper wall along
/// each axis, m.
///
/// # Panics
/// If the shape of a window's positions or static features, of the normalisation or of the bounds
/// does not fit the network.
pub fn window_input<B: Backend>(
    windows: &[Window],
    config: &ModelConfig,
    norm: &Normalisation,
    bounds: &[[f64; 2]],
    device: &B::Device,
) -> WindowInput<B> {
    let batches = host_frames(windows, config, norm, bounds);
    let points = windows.iter().map(|window| window.points).sum();
    let frames = batches
        .iter()
        .enumerate()
        .map(|(k, frame)| {
            let before = if config.edge_message && k > 0 { batches.get(k - 1) } else { None };
            frame.to_device(before, device)
        })
        .collect();
    WindowInput { frames, points }
}

/// As [`window_input`], but in host memory.
///
/// # Panics
/// As [`window_input`].
pub fn host_frames(
    windows: &[Window],
    config: &ModelConfig,
    norm: &Normalisation,
    bounds: &[[f64; 2]],
) -> Vec<HostFrame> {
    assert_eq!(bounds.len(), config.dimensions);
    assert_eq!(norm.velocity_mean.len(), config.dimensions);
    assert_eq!(norm.velocity_std.len(), config.dimensions);
    for window in windows {
        assert_eq!(window.positions.len(), config.window() * window.points * config.dimensions);
        let [all, statics] = feature_columns(&config.node_features, config.dimensions);
        assert_eq!(window.statics.len(), window.points * statics);
        assert_eq!([norm.features_mean.len(), norm.features_std.len()], [all; 2]);
    }
    let features = Features { config, norm, bounds };
    (config.window() - config.graphs()..config.window())
        .into_par_iter()
        .map(|frame| {
            let parts: Vec<_> =
                windows.par_iter().map(|window| features.frame(window, frame)).collect();
            HostFrame::side_by_side(parts, features.columns(frame))
        })
        .collect()
}

/// What the features of all frames depend on.
struct Features<'a> {
    config: &'a ModelConfig,
    norm: &'a Normalisation,
    bounds: &'a [[f64; 2]],
}

impl Features<'_> {
    /// The network's first frame in a window; earlier ones serve optional features.
    fn oldest(&self) -> usize {
        self.config.window() - self.config.frames
    }

    /// Columns of a node and of an edge.
    fn columns(&self, frame: usize) -> [usize; 2] {
        let config = self.config;
        match config.kind {
            ModelKind::Tgnns if frame > self.oldest() => {
                [config.later_node_features(), config.later_edge_features()]
            }
            ModelKind::Tgnns => [config.first_node_features(), config.first_edge_features()],
            ModelKind::Gns => [config.gns_node_features(), config.first_edge_features()],
        }
    }

    fn frame(&self, window: &Window, frame: usize) -> HostFrame {
        let stride = window.points * self.config.dimensions;
        let at = |k: usize| &window.positions[k * stride..(k + 1) * stride];
        let graph = radius_graph(at(frame), self.config.connection_radius as f32);
        let (mut nodes, mut edges) = (Vec::new(), Vec::new());
        let steps = match self.config.kind {
            ModelKind::Tgnns => frame..frame + 1,
            ModelKind::Gns => self.oldest()..frame + 1,
        };
        let further = self.further(window, frame);
        let width = self.config.further_node_features();
        for point in 0..window.points {
            for k in steps.clone().filter(|&k| k > self.oldest()) {
                self.velocity(at(k - 1), at(k), point, &mut nodes);
            }
            self.wall_distances(at(frame), point, window.obstacles, &mut nodes);
            nodes.extend(&further[point * width..(point + 1) * width]);
        }
        let moving = self.config.kind == ModelKind::Tgnns && frame > self.oldest();
        for (receiver, sender) in graph.pairs() {
            if moving {
                self.relative_velocity(at(frame - 1), at(frame), receiver, sender, &mut edges);
            }
            self.separation(at(frame), receiver, sender, &mut edges);
        }
        HostFrame::new(window.points, nodes, edges, &graph, self.columns(frame))
    }

    /// (x_k - x_(k-1) - mean) / std of one point.
    fn velocity(&self, before: &[f32], now: &[f32], point: usize, features: &mut Vec<f32>) {
        let d = self.config.dimensions;
        features.extend((0..d).map(|k| {
            let step = now[point * d + k] - before[point * d + k];
            (step - self.norm.velocity_mean[k] as f32) / self.norm.velocity_std[k] as f32
        }));
    }

    /// Velocity of the sender relative to the receiver, / std.
    fn relative_velocity(
        &self,
        before: &[f32],
        now: &[f32],
        receiver: usize,
        sender: usize,
        features: &mut Vec<f32>,
    ) {
        let d = self.config.dimensions;
        features.extend((0..d).map(|k| {
            let step = |point: usize| now[point * d + k] - before[point * d + k];
            (step(sender) - step(receiver)) / self.norm.velocity_std[k] as f32
        }));
    }

    /// Distances to the nearest wall below and above along each axis, in radii. Faces of obstacles are
    /// walls for the points in front of them.
    fn wall_distances(
        &self,
        now: &[f32],
        point: usize,
        obstacles: &[Obstacle],
        features: &mut Vec<f32>,
    ) {
        let d = self.config.dimensions;
        let radius = self.config.connection_radius as f32;
        let scaled = |distance: f32| match self.config.clamps_walls() {
            true => (distance / radius).clamp(-1.0, 1.0),
            false if distance > radius => 0.0,
            false => distance / radius,
        };
        let skin = SKIN * radius;
        let place = &now[point * d..(point + 1) * d];
        for (k, [lower, upper]) in self.bounds.iter().enumerate() {
            let x = place[k];
            let mut distances = [x - *lower as f32, *upper as f32 - x];
            let fixed = obstacles.iter().filter(|o| self.config.obstacles && o.is_fixed());
            for [low, high] in fixed.map(|obstacle| obstacle.corners_at(0)) {
                let beside = |j: usize| place[j] <= low[j] + skin || place[j] >= high[j] - skin;
                if (0..d).any(|j| j != k && beside(j)) {
                    continue;
                }
                for (nearest, distance) in distances.iter_mut().zip([x - high[k], low[k] - x]) {
                    if distance >= -skin {
                        *nearest = nearest.min(distance.max(0.0));
                    }
                }
            }
            features.extend(distances.map(scaled));
        }
    }

    /// Optional features of all points.
    fn further(&self, window: &Window, frame: usize) -> Vec<f32> {
        let ModelConfig { node_features: features, dimensions, connection_radius, .. } =
            self.config;
        let stride = (window.points * dimensions).max(1);
        let frames: Vec<&[f32]> = window.positions.chunks_exact(stride).take(frame + 1).collect();
        let back = self.config.window() - 1 - frame;
        let radius = *connection_radius as f32;
        let moving = moving_features(features, &frames, window.obstacles, back, radius);
        standardised(features, self.norm, window.points, window.statics, &moving)
    }

    /// From receiver to sender: direction (GNS: displacement / radius) and distance / radius. Points
    /// at the same position have direction 0.
    fn separation(&self, now: &[f32], receiver: usize, sender: usize, features: &mut Vec<f32>) {
        let d = self.config.dimensions;
        let radius = self.config.connection_radius as f32;
        let displacement = |k: usize| now[sender * d + k] - now[receiver * d + k];
        let distance = (0..d).map(|k| displacement(k).powi(2)).sum::<f32>().sqrt();
        let unit = match self.config.kind {
            ModelKind::Tgnns if distance > 0.0 => distance,
            _ => radius,
        };
        features.extend((0..d).map(|k| displacement(k) / unit));
        features.push(distance / radius);
    }
}
