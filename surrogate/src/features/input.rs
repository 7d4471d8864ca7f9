//! Input tensors of a network.

#[cfg(feature = "burn-cuda")]
use burn::tensor::TensorData;
use burn::tensor::backend::Backend;
use burn::tensor::{Int, Tensor};

/// Features and graph of one frame of a batch.
///
/// The graphs of the windows stand side by side: the points of each are numbered after those of
/// the one before. Edges are sorted by receiver, then by sender.
#[derive(Clone, Debug)]
pub struct FrameInput<B: Backend> {
    /// Node features, points x columns.
    pub nodes: Tensor<B, 2>,
    /// Edge features, edges x columns.
    pub edges: Tensor<B, 2>,
    /// Sender w of each edge.
    pub sender: Tensor<B, 1, Int>,
    /// Receiver v of each edge.
    pub receiver: Tensor<B, 1, Int>,
    /// Edges shared with the previous frame, for networks that carry edge states.
    pub persistence: Option<Persistence<B>>,
}

/// The edges of a frame, split into those that the previous frame's graph has too and new ones.
#[derive(Clone, Debug)]
pub struct Persistence<B: Backend> {
    /// Indices of the persistent edges in this frame.
    pub persistent: Tensor<B, 1, Int>,
    /// Indices of the same edges in the previous frame.
    pub previous: Tensor<B, 1, Int>,
    /// Indices of the new edges in this frame.
    pub new: Tensor<B, 1, Int>,
    /// Position of each edge in the list of persistent edges followed by new ones.
    pub place: Tensor<B, 1, Int>,
}

/// Input of a network: one frame for each of the window (TGNNS), or its last one (GNS).
#[derive(Clone, Debug)]
pub struct WindowInput<B: Backend> {
    /// The frames, the oldest first.
    pub frames: Vec<FrameInput<B>>,
    /// Points of all windows together.
    pub points: usize,
}

#[cfg(feature = "burn-cuda")]
impl<B: Backend> WindowInput<B> {
    /// The same on a device of another backend.
    pub fn to_device<To: Backend>(&self, device: &To::Device) -> WindowInput<To> {
        let matrix = |of: &Tensor<B, 2>| Tensor::<To, 2>::from_data(of.to_data(), device);
        let indices = |of: &Tensor<B, 1, Int>| {
            let values: Vec<i32> = of.to_data().iter::<i32>().collect();
            let length = values.len();
            Tensor::<To, 1, Int>::from_data(TensorData::new(values, [length]), device)
        };
        let frame = |frame: &FrameInput<B>| FrameInput {
            nodes: matrix(&frame.nodes),
            edges: matrix(&frame.edges),
            sender: indices(&frame.sender),
            receiver: indices(&frame.receiver),
            persistence: frame.persistence.as_ref().map(|edges| Persistence {
                persistent: indices(&edges.persistent),
                previous: indices(&edges.previous),
                new: indices(&edges.new),
                place: indices(&edges.place),
            }),
        };
        WindowInput { frames: self.frames.iter().map(frame).collect(), points: self.points }
    }
}
