//! Predictions frame after frame: each frame goes through the network once.

use cudarc::driver::CudaSlice;

use super::error::CudaError;
use super::network::{CudaNetwork, FrameView};
use super::ops::frame_input::FrameInput;
use crate::network::ModelKind;

impl CudaNetwork {
    /// Takes the next frame, with the features of later ones (the GNS: those of its only one), and
    /// gives the normalised accelerations of the window that ends with it, once that many frames were
    /// given. `before` is the frame of the call before. Does not wait.
    ///
    /// A layer of a TGNNS reads one frame of the window and the node states that the layer before it
    /// made of the frame before. So all of them can work on the same frame at once, each for
    /// another window: the one in which the frame has the layer's place. What they make of it is kept
    /// for the next frame.
    ///
    /// # Errors
    /// If there are more points or edges than there is memory for.
    pub fn advance(
        &mut self,
        frame: &FrameInput,
        before: &FrameInput,
    ) -> Result<&CudaSlice<f32>, CudaError> {
        let (first, view) = (self.frame_view(frame, true)?, self.frame_view(frame, false)?);
        let before = self.frame_view(before, false)?;
        self.advance_layers(&first, &view, &before, self.layout.frames)?;
        Ok(&self.output)
    }

    /// Takes the frames of a window, as [`forward`](Self::forward) does, and gives the same; but
    /// [`advance`](Self::advance) can go on from there. Does not wait.
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    pub fn begin(&mut self, frames: &[FrameInput]) -> Result<&CudaSlice<f32>, CudaError> {
        let views = self.views(frames)?;
        for (k, view) in views.iter().enumerate() {
            let first = if k == 0 { *view } else { self.frame_view(&frames[k], true)? };
            // In the windows that matter the frame has no later place than this one.
            self.advance_layers(&first, view, &views[k.saturating_sub(1)], k + 1)?;
        }
        Ok(&self.output)
    }

    /// The layers that read a frame at one of the first `places` of a window; if these are all places,
    /// the layers that follow too. `first` and `view` are the frame with the features of a first and of
    /// a later one.
    fn advance_layers(
        &self,
        first: &FrameView,
        view: &FrameView,
        before: &FrameView,
        places: usize,
    ) -> Result<(), CudaError> {
        self.kernels.launcher.begin_pass(false);
        // Later places share their encodings, but for `edgemsg`.
        let encoded = if self.layout.edge_fusion.is_some() { places } else { places.min(2) };
        let views = (0..encoded).map(|k| (k, if k == 0 { first } else { view }));
        self.encode(&views.collect::<Vec<_>>())?;
        if places > 1 {
            self.fuse(1..places, before, view)?;
        }
        self.message_layers(0..places, view)?;
        if places < self.layout.frames {
            return Ok(());
        }
        for layer in places..self.layout.layers.len() {
            self.message_layers(layer..layer + 1, view)?;
        }
        self.decode(view)
    }

    /// Times of the kernels of [`advance`](Self::advance): name, launches, ms. Waits.
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    pub fn profile_advance(
        &mut self,
        frame: &FrameInput,
        before: &FrameInput,
    ) -> Result<Vec<(&'static str, usize, f32)>, CudaError> {
        self.kernels.launcher.profile.begin();
        let done = self.advance(frame, before).map(|_| ());
        let times = self.kernels.launcher.profile.end();
        done?;
        times
    }

    /// A frame with the features of later ones, as the `first` of a window or a later one. The first
    /// one has no velocities, which come first in a row.
    fn frame_view(&self, frame: &FrameInput, first: bool) -> Result<FrameView, CudaError> {
        let config = &self.config;
        match config.kind {
            ModelKind::Gns => {
                self.view(frame, [config.gns_node_features(), config.first_edge_features()], 0)
            }
            ModelKind::Tgnns => {
                let columns = [config.later_node_features(), config.later_edge_features()];
                self.view(frame, columns, if first { config.dimensions } else { 0 })
            }
        }
    }
}
