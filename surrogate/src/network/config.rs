//! Architecture of a network: kind, sizes, connection radius; and the ten networks of the paper
//! (Zhao, Chen, Zhao, CMAME 433, 2025, 117536, Table 6).

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::mlp::MlpShape;
use super::node_feature::{NodeFeature, feature_columns};

/// Dimensions of space.
pub const DIMENSIONS: usize = 2;

/// Networks of the paper's Table 6, in its order, for [`ModelConfig::named`].
pub const PAPER_NETWORKS: [&str; 10] = [
    "baseline",
    "hidden1",
    "msg1",
    "msg0",
    "msg0-hidden1",
    "frame4",
    "frame4-msg0-hidden1",
    "frame4-msg1",
    "frame4-hidden1",
    "frame4-msg1-hidden1-edgemsg",
];

/// Kind of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ModelKind {
    /// The temporal graph neural network simulator of the paper: one graph per frame.
    Tgnns,
    /// Graph network simulator of Sanchez-Gonzalez et al. (ICML 2020): one graph, of the last frame.
    Gns,
}

/// Architecture of a network. The default is the paper's Baseline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ModelConfig {
    /// Kind of the network.
    pub kind: ModelKind,
    /// [`DIMENSIONS`], which weights and training files may state.
    pub dimensions: usize,
    /// Width of all latent states.
    pub width: usize,
    /// Hidden layers of each MLP.
    pub hidden_layers: usize,
    /// Message-passing layers after the last frame's own (TGNNS).
    pub message_layers: usize,
    /// Message-passing layers after those that add to the node states (TGNNS).
    #[serde(skip_serializing_if = "is_zero")]
    pub residual_layers: usize,
    /// Frames of a window; the newest is advanced.
    pub frames: usize,
    /// Carry edge states from frame to frame along persistent edges (TGNNS, `edgemsg`).
    pub edge_message: bool,
    /// Slope of LeakyReLU for negative arguments (TGNNS; the GNS uses ReLU).
    pub leaky_slope: f64,
    /// Points closer than this are neighbours, m.
    pub connection_radius: f64,
    /// Message-passing layers (GNS).
    pub gns_layers: usize,
    /// Node features besides velocity and walls, in this order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub node_features: Vec<NodeFeature>,
    /// Whether faces of fixed obstacles count as walls.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub obstacles: bool,
    /// Whether walls beyond the radius count as one radius away, as in the GNS, instead of 0 (TGNNS).
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub clamped_walls: bool,
}

impl Default for ModelConfig {
    fn default() -> Self {
        Self {
            kind: ModelKind::Tgnns,
            dimensions: DIMENSIONS,
            width: 128,
            hidden_layers: 2,
            message_layers: 2,
            residual_layers: 0,
            frames: 6,
            edge_message: false,
            leaky_slope: 0.1,
            connection_radius: 0.25,
            gns_layers: 10,
            node_features: Vec::new(),
            obstacles: false,
            clamped_walls: false,
        }
    }
}

pub(crate) fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// An invalid value in a [`ModelConfig`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("model: `{key}` is {value}, but must be {range}")]
pub struct ConfigError {
    /// The key.
    pub key: &'static str,
    /// Its value.
    pub value: f64,
    /// Valid values.
    pub range: &'static str,
}

/// Differences of two tables, each as "`width` is 128, not 32". Keys of nested tables read
/// `data.noise`.
pub fn differences(mine: &Value, theirs: &Value) -> Vec<String> {
    let keys = |of: &Value| {
        of.as_object().into_iter().flat_map(|o| o.keys().cloned()).collect::<BTreeSet<_>>()
    };
    let said =
        |value: &Value| if value.is_null() { "not set".to_owned() } else { value.to_string() };
    let mut found = Vec::new();
    for key in &keys(mine) | &keys(theirs) {
        let (a, b) = (&mine[&key], &theirs[&key]);
        if a.is_object() && b.is_object() {
            let within = differences(a, b).into_iter();
            found.extend(within.map(|text| text.replacen('`', &format!("`{key}."), 1)));
        } else if a != b {
            found.push(format!("`{key}` is {}, not {}", said(a), said(b)));
        }
    }
    found
}

impl ModelConfig {
    /// One of [`PAPER_NETWORKS`] in two dimensions, or `gns`.
    pub fn named(name: &str) -> Option<Self> {
        let tgnns = |hidden_layers, message_layers, frames, edge_message| Self {
            hidden_layers,
            message_layers,
            frames,
            edge_message,
            ..Self::default()
        };
        Some(match name {
            "baseline" => tgnns(2, 2, 6, false),
            "hidden1" => tgnns(1, 2, 6, false),
            "msg1" => tgnns(2, 1, 6, false),
            "msg0" => tgnns(2, 0, 6, false),
            "msg0-hidden1" => tgnns(1, 0, 6, false),
            "frame4" => tgnns(2, 2, 4, false),
            "frame4-msg0-hidden1" => tgnns(1, 0, 4, false),
            "frame4-msg1" => tgnns(2, 1, 4, false),
            "frame4-hidden1" => tgnns(1, 2, 4, false),
            "frame4-msg1-hidden1-edgemsg" => tgnns(1, 1, 4, true),
            "gns" => Self { kind: ModelKind::Gns, ..Self::default() },
            _ => return None,
        })
    }

    /// Number of trainable parameters.
    pub fn parameter_count(&self) -> usize {
        let states = |n: usize| self.mlp(n * self.width, self.width).parameter_count();
        let encoder = |features| self.mlp(features, self.width).parameter_count();
        let message_layer = states(3) + states(2);
        let decoder = self.decoder().parameter_count();
        match self.kind {
            ModelKind::Tgnns => {
                encoder(self.first_node_features())
                    + encoder(self.later_node_features())
                    + encoder(self.first_edge_features())
                    + encoder(self.later_edge_features())
                    + states(2)
                    + (self.frames + self.message_layers + self.residual_layers) * message_layer
                    + decoder
                    + if self.edge_message {
                        encoder(self.width + self.later_edge_features())
                    } else {
                        0
                    }
            }
            ModelKind::Gns => {
                encoder(self.gns_node_features())
                    + encoder(self.first_edge_features())
                    + self.gns_layers * message_layer
                    + decoder
            }
        }
    }

    /// Validates all values, so that building the network cannot fail.
    ///
    /// # Errors
    /// The first key out of range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let whole = |key, value: usize, low: usize, high: usize, range| {
            if (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(ConfigError { key, value: value as f64, range })
            }
        };
        whole("dimensions", self.dimensions, 2, 2, "2")?;
        whole("width", self.width, 2, 4096, "from 2 to 4096")?;
        whole("hidden_layers", self.hidden_layers, 1, 16, "from 1 to 16")?;
        whole("message_layers", self.message_layers, 0, 64, "from 0 to 64")?;
        whole("residual_layers", self.residual_layers, 0, 64, "from 0 to 64")?;
        whole("frames", self.frames, 2, 64, "from 2 to 64")?;
        whole("gns_layers", self.gns_layers, 1, 64, "from 1 to 64")?;
        let real = |key, value: f64, valid: bool, range| {
            if valid { Ok(()) } else { Err(ConfigError { key, value, range }) }
        };
        let (slope, radius) = (self.leaky_slope, self.connection_radius);
        real("leaky_slope", slope, (0.0..=1.0).contains(&slope), "from 0 to 1")?;
        real("connection_radius", radius, radius > 0.0 && radius.is_finite(), "positive (metres)")
    }

    /// Differences to another architecture, each as "`width` is 128, not 32".
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let values = |config: &Self| serde_json::to_value(config).expect("plain data");
        differences(&values(self), &values(other))
    }

    /// Frames of positions that a prediction needs: those of the network and earlier ones for node
    /// features.
    pub fn window(&self) -> usize {
        self.frames + self.node_features.iter().map(|f| f.frames_before()).max().unwrap_or(0)
    }

    /// Graphs of a window: one per frame, or one of the newest frame (GNS).
    pub fn graphs(&self) -> usize {
        match self.kind {
            ModelKind::Tgnns => self.frames,
            ModelKind::Gns => 1,
        }
    }

    /// Whether boxes are among its inputs, as walls or as surfaces.
    pub fn sees_boxes(&self) -> bool {
        self.obstacles || self.sees_surfaces()
    }

    /// Whether surfaces of boxes are among its inputs, those of plates too.
    pub fn sees_surfaces(&self) -> bool {
        self.node_features.contains(&NodeFeature::Surfaces)
    }

    /// Whether walls beyond the radius count as one radius away.
    pub fn clamps_walls(&self) -> bool {
        self.clamped_walls || self.kind == ModelKind::Gns
    }

    /// Columns of the optional [`node_features`](Self::node_features).
    pub fn further_node_features(&self) -> usize {
        feature_columns(&self.node_features, self.dimensions)[0]
    }

    /// Columns of a node in the first frame: distances to the 2 n_d walls, optional features.
    pub fn first_node_features(&self) -> usize {
        2 * self.dimensions + self.further_node_features()
    }

    /// Columns of a node in later frames: velocity, distances to the walls, optional features.
    pub fn later_node_features(&self) -> usize {
        3 * self.dimensions + self.further_node_features()
    }

    /// Columns of an edge in the first frame: direction and distance.
    pub fn first_edge_features(&self) -> usize {
        self.dimensions + 1
    }

    /// Columns of an edge in later frames: relative velocity, direction and distance.
    pub fn later_edge_features(&self) -> usize {
        2 * self.dimensions + 1
    }

    /// Columns of a node of the GNS: all velocities of the window, distances to the walls, optional
    /// features.
    pub fn gns_node_features(&self) -> usize {
        (self.frames + 1) * self.dimensions + self.further_node_features()
    }

    /// Shape of an MLP with LayerNorm.
    pub(crate) fn mlp(&self, input: usize, output: usize) -> MlpShape {
        let slope = match self.kind {
            ModelKind::Tgnns => self.leaky_slope,
            ModelKind::Gns => 0.0,
        };
        MlpShape {
            input,
            width: self.width,
            hidden_layers: self.hidden_layers,
            output,
            norm: true,
            slope,
        }
    }

    /// Shape of the decoder, from node state to normalised acceleration; without LayerNorm.
    pub(crate) fn decoder(&self) -> MlpShape {
        MlpShape { norm: false, ..self.mlp(self.width, self.dimensions) }
    }
}
