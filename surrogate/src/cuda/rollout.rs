//! Predictions frame after frame: encodings are kept while a frame is in the window.

use cudarc::driver::CudaSlice;

use super::buffers::FrameInput;
use super::error::CudaError;
use super::network::{CudaNetwork, View};
use crate::config::ModelKind;

impl CudaNetwork {
    /// Normalised accelerations of a window, the oldest frame first. All frames have the features
    /// of later ones, whose leading velocities the first one ignores (the GNS reads one frame).
    /// `moved`: the window is that of the call before, moved on by one frame, and the encodings
    /// of the frames that both have are used again. Does not wait.
    ///
    /// # Errors
    /// If there are more points or edges than there is room for, or the number of frames is wrong.
    pub fn advance(
        &mut self,
        frames: &[&FrameInput],
        moved: bool,
    ) -> Result<&CudaSlice<f32>, CudaError> {
        let (found, room) = (frames.len(), self.layout.frames);
        if found != room {
            return Err(CudaError::Room { what: "frames", found, room });
        }
        let views = frames
            .iter()
            .enumerate()
            .map(|(k, frame)| self.later_view(k, frame))
            .collect::<Result<Vec<View>, _>>()?;
        let newest = views.len() - 1;
        // `edgemsg` writes the joined edge states over the encoded ones.
        let kept = moved && newest > 0 && self.room.training.is_none();
        if kept {
            self.room.frames[1..].rotate_left(1);
        }
        let encoded = |k: &usize| !kept || *k == 0 || *k == newest;
        let edge_encoded = |k: &usize| encoded(k) || self.layout.edge_fusion.is_some();
        let all = 0..views.len();
        let nodes: Vec<_> =
            all.clone().filter(encoded).map(|k| self.node_encoder(k, &views[k])).collect();
        let edges: Vec<_> =
            all.filter(edge_encoded).map(|k| self.edge_encoder(k, &views[k])).collect();
        self.kernels.forward(&nodes, self.room.capacity.points)?;
        self.kernels.forward(&edges, self.room.capacity.edges)?;
        self.pass_messages(&views)?;
        Ok(&self.output)
    }

    /// Times of the kernels of [`advance`](Self::advance) on a window that has moved: name,
    /// launches, ms. Waits.
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    pub fn profile_advance(
        &mut self,
        frames: &[&FrameInput],
    ) -> Result<Vec<(&'static str, usize, f32)>, CudaError> {
        self.kernels.profile.begin();
        let done = self.advance(frames, true).map(|_| ());
        let times = self.kernels.profile.end();
        done?;
        times
    }

    /// What [`advance`](Self::advance) queues on the same frames is the same again after so many
    /// calls: the encodings take turns.
    pub fn period(&self) -> usize {
        (self.layout.frames - 1).max(1)
    }

    fn later_view(&self, place: usize, frame: &FrameInput) -> Result<View, CudaError> {
        let config = &self.config;
        match config.kind {
            ModelKind::Gns => {
                self.view(frame, (config.gns_node_features(), config.first_edge_features()), 0)
            }
            ModelKind::Tgnns => {
                let columns = (config.later_node_features(), config.later_edge_features());
                self.view(frame, columns, if place == 0 { config.dimensions } else { 0 })
            }
        }
    }
}
