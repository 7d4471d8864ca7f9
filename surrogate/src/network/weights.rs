//! Weights files: safetensors with the architecture in the metadata. Names, shapes and the order of
//! indices are PyTorch's; see docs/weights.md.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};
use safetensors::SafeTensorError;
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde::{Deserialize, Serialize};

use super::config::{ConfigError, ModelConfig};
use super::model::Model;
use super::node_feature::NodeFeature;
use crate::features::Normalisation;

/// Key of the metadata, whose value is JSON. A single key, so that equal files have equal bytes.
const METADATA_KEY: &str = "surrogate";
/// Newest version of the format. The second has features of surfaces and material, the third residual
/// layers.
const NEWEST_FORMAT: u32 = 3;

/// Why a weights file could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// The file cannot be read or written.
    #[error("{path}: cannot {action} it")]
    Io {
        /// The file.
        path: PathBuf,
        /// What failed.
        action: &'static str,
        /// The error of the file system.
        source: std::io::Error,
    },
    /// Not a safetensors file.
    #[error("{path}: not a safetensors file")]
    Format {
        /// The file.
        path: PathBuf,
        /// The error of the format.
        source: SafeTensorError,
    },
    /// The metadata are missing, damaged or of another version.
    #[error("{path}: not a weights file of surrogate: {reason}")]
    Metadata {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The architecture is invalid.
    #[error("{path}: not a network of surrogate")]
    Config {
        /// The file.
        path: PathBuf,
        /// The key and its valid values.
        source: ConfigError,
    },
    /// The tensors have another number of parameters than the architecture.
    #[error("{path}: the tensors have {parameters} parameters, but the network has {expected}")]
    Size {
        /// The file.
        path: PathBuf,
        /// Parameters in the tensors.
        parameters: usize,
        /// Parameters of the network.
        expected: usize,
    },
    /// A tensor is missing.
    #[error("{path}: tensor `{name}` is missing")]
    Missing {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
    },
    /// A tensor of another type or shape.
    #[error("{path}: tensor `{name}` is {dtype:?} {shape:?}, not {expected_dtype:?} {expected:?}")]
    Shape {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// Its type.
        dtype: Dtype,
        /// Its shape.
        shape: Vec<usize>,
        /// The type it should have.
        expected_dtype: Dtype,
        /// The shape it should have.
        expected: Vec<usize>,
    },
    /// Weights that are not finite, or a normalisation that is not finite or not positive.
    #[error("{path}: tensor `{name}`: {reason}")]
    Value {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// What is wrong.
        reason: &'static str,
    },
}

/// The metadata.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Metadata {
    format: u32,
    config: ModelConfig,
    extra: BTreeMap<String, String>,
    /// [`digest`] of all else; none in files of other programs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    hash: Option<String>,
}

impl Metadata {
    /// BLAKE3 hash (hexadecimal) of the other metadata and of name, type, shape and bytes of every
    /// tensor, in the order of their names.
    fn digest(
        &self,
        mut tensors: Vec<(&str, Dtype, &[usize], &[u8])>,
    ) -> serde_json::Result<String> {
        tensors.sort_unstable_by_key(|tensor| tensor.0);
        let mut hasher = blake3::Hasher::new();
        hasher.update(serde_json::to_string(&(self.format, &self.config, &self.extra))?.as_bytes());
        for (name, dtype, shape, bytes) in tensors {
            hasher.update(format!("{name} {dtype:?} {shape:?}").as_bytes());
            hasher.update(bytes);
        }
        Ok(hasher.finalize().to_hex().to_string())
    }
}

/// The oldest version of the format that has all features of a network, so that files of networks without
/// new ones stay the same.
fn format_of(config: &ModelConfig) -> u32 {
    let is_new = |f: &NodeFeature| matches!(f, NodeFeature::Surfaces | NodeFeature::Material);
    if config.residual_layers > 0 {
        3
    } else if config.node_features.iter().any(is_new) {
        2
    } else {
        1
    }
}

/// Writes a weights file, in place: to survive a crash, write to a temporary name and rename.
/// `extra` is further metadata of the caller.
///
/// # Errors
/// If the file cannot be written.
pub fn save<B: Backend>(
    path: &Path,
    model: &Model<B>,
    config: &ModelConfig,
    normalisation: &Normalisation,
    extra: BTreeMap<String, String>,
) -> Result<(), WeightsError> {
    let format = format_of(config);
    let mut metadata = Metadata { format, config: config.clone(), extra, hash: None };
    let mut collect = Collect::default();
    model.visit(&mut collect);
    let mut tensors = collect.tensors;
    for (name, values) in normalisation_tensors(normalisation) {
        if values.is_empty() {
            continue;
        }
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        tensors.push(Stored { name, dtype: Dtype::F64, shape: vec![values.len()], bytes });
    }
    let parts = tensors.iter().map(|t| (&*t.name, t.dtype, &*t.shape, &*t.bytes)).collect();
    let unwritable =
        |e: serde_json::Error| WeightsError::Metadata { path: path.into(), reason: e.to_string() };
    metadata.hash = Some(metadata.digest(parts).map_err(unwritable)?);
    let json = serde_json::to_string(&metadata).map_err(unwritable)?;
    let format = |source| WeightsError::Format { path: path.into(), source };
    let views = tensors
        .iter()
        .map(|t| Ok((&t.name, TensorView::new(t.dtype, t.shape.clone(), &t.bytes)?)))
        .collect::<Result<Vec<_>, _>>()
        .map_err(format)?;
    let metadata = HashMap::from([(METADATA_KEY.to_string(), json)]);
    let bytes = serialize(views, Some(metadata)).map_err(format)?;
    std::fs::write(path, bytes).map_err(|source| WeightsError::Io {
        path: path.into(),
        action: "write",
        source,
    })
}

/// Reads network, architecture, normalisation and further metadata from a file of [`save`].
///
/// # Errors
/// If the file cannot be read, or is damaged or of another program.
#[allow(clippy::type_complexity)]
pub fn load<B: Backend>(
    path: &Path,
    device: &B::Device,
) -> Result<(Model<B>, ModelConfig, Normalisation, BTreeMap<String, String>), WeightsError> {
    let bytes = std::fs::read(path).map_err(|source| WeightsError::Io {
        path: path.into(),
        action: "read",
        source,
    })?;
    let format = |source| WeightsError::Format { path: path.into(), source };
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(format)?;
    let file = File { path, tensors: SafeTensors::deserialize(&bytes).map_err(format)? };
    let json = header.metadata().as_ref().and_then(|m| m.get(METADATA_KEY));
    let json = json.ok_or_else(|| file.metadata(format!("no `{METADATA_KEY}` in its metadata")))?;
    let metadata: Metadata =
        serde_json::from_str(json).map_err(|e| file.metadata(e.to_string()))?;
    if !(1..=NEWEST_FORMAT).contains(&metadata.format) {
        let reason = format!("format {}, not 1 to {NEWEST_FORMAT}", metadata.format);
        return Err(file.metadata(reason));
    }
    let config = metadata.config.clone();
    config.validate().map_err(|source| WeightsError::Config { path: path.into(), source })?;
    let normalisation = file.normalisation(&config)?;
    file.check_size(&config)?;
    let mut fill = Fill { names: Names::default(), file: &file, error: None };
    let model = Model::new(&config, 0, device).map(&mut fill);
    if let Some(error) = fill.error {
        return Err(error);
    }
    // Last: what else is wrong says more.
    file.check_hash(&metadata)?;
    Ok((model, config, normalisation, metadata.extra))
}

/// The normalisation as tensors: unlike JSON, they keep every bit of float64.
fn normalisation_tensors(n: &Normalisation) -> [(String, &[f64]); 6] {
    [
        ("normalisation.velocity_mean".into(), &n.velocity_mean),
        ("normalisation.velocity_std".into(), &n.velocity_std),
        ("normalisation.acceleration_mean".into(), &n.acceleration_mean),
        ("normalisation.acceleration_std".into(), &n.acceleration_std),
        ("normalisation.features_mean".into(), &n.features_mean),
        ("normalisation.features_std".into(), &n.features_std),
    ]
}

/// A tensor of the file.
struct Stored {
    name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

/// Name of the current parameter in a walk through the modules.
#[derive(Default)]
struct Names(Vec<String>);

impl Names {
    fn enter(&mut self, name: &str, container: &str) {
        // The variant is the kind of network, which the architecture states.
        let name = if container.starts_with("Enum:") { "" } else { name };
        // PyTorch's names of LayerNorm's scale and shift.
        let name = match name {
            "gamma" => "weight",
            "beta" => "bias",
            other => other,
        };
        self.0.push(name.to_string());
    }

    fn exit(&mut self) {
        self.0.pop();
    }

    fn name(&self) -> String {
        let parts: Vec<&str> =
            self.0.iter().map(String::as_str).filter(|n| !n.is_empty()).collect();
        parts.join(".")
    }
}

/// Collects all parameters of a network.
#[derive(Default)]
struct Collect {
    names: Names,
    tensors: Vec<Stored>,
}

impl<B: Backend> ModuleVisitor<B> for Collect {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.names.enter(name, container);
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.names.exit();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        let data = to_file_order(param.val()).into_data().convert::<f32>();
        let shape = data.shape.to_vec();
        let bytes = data.iter::<f32>().flat_map(f32::to_le_bytes).collect();
        self.tensors.push(Stored { name: self.names.name(), dtype: Dtype::F32, shape, bytes });
    }
}

/// Fills a network with the values of a file.
struct Fill<'a> {
    names: Names,
    file: &'a File<'a>,
    error: Option<WeightsError>,
}

impl<B: Backend> ModuleMapper<B> for Fill<'_> {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.names.enter(name, container);
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.names.exit();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        let old = param.val();
        let shape = to_file_order(old.clone()).dims();
        match self.file.values(&self.names.name(), Dtype::F32, &shape) {
            Ok(bytes) => {
                let values: Vec<f32> =
                    bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
                if values.iter().any(|value| !value.is_finite()) {
                    self.error.get_or_insert(WeightsError::Value {
                        path: self.file.path.into(),
                        name: self.names.name(),
                        reason: "holds values that are not finite",
                    });
                }
                let data = TensorData::new::<f32, _>(values, shape);
                let tensor = Tensor::<B, D>::from_data(data, &old.device());
                param.map(|_| to_file_order(tensor).require_grad())
            }
            Err(error) => {
                self.error.get_or_insert(error);
                param
            }
        }
    }
}

/// Matrices are outputs x inputs in the file, as in PyTorch, and inputs x outputs in Burn. Its own
/// inverse.
fn to_file_order<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Tensor<B, D> {
    if D == 2 { tensor.transpose() } else { tensor }
}

/// A file being read.
struct File<'a> {
    path: &'a Path,
    tensors: SafeTensors<'a>,
}

impl<'a> File<'a> {
    fn metadata(&self, reason: String) -> WeightsError {
        WeightsError::Metadata { path: self.path.into(), reason }
    }

    /// Checks the hash, if the file has one.
    fn check_hash(&self, metadata: &Metadata) -> Result<(), WeightsError> {
        let Some(expected) = &metadata.hash else { return Ok(()) };
        let tensors: Vec<_> = self.tensors.iter().collect();
        let parts = tensors.iter().map(|(name, t)| (*name, t.dtype(), t.shape(), t.data()));
        let parts = parts.collect();
        match metadata.digest(parts) {
            Ok(found) if found == *expected => Ok(()),
            _ => Err(self.metadata(
                "damaged, or changed by another program, which has to leave out `hash`".into(),
            )),
        }
    }

    /// Checks the number of parameters before anything of the network's size is allocated.
    fn check_size(&self, config: &ModelConfig) -> Result<(), WeightsError> {
        let f32s = self.tensors.iter().filter(|(_, t)| t.dtype() == Dtype::F32);
        let parameters = f32s.map(|(_, t)| t.data().len() / 4).sum();
        let expected = config.parameter_count();
        if parameters == expected {
            Ok(())
        } else {
            Err(WeightsError::Size { path: self.path.into(), parameters, expected })
        }
    }

    /// Bytes of a tensor, whose type and shape are checked.
    fn values(&self, name: &str, dtype: Dtype, shape: &[usize]) -> Result<&[u8], WeightsError> {
        let missing = |_| WeightsError::Missing { path: self.path.into(), name: name.into() };
        let tensor = self.tensors.tensor(name).map_err(missing)?;
        if tensor.dtype() != dtype || tensor.shape() != shape {
            return Err(WeightsError::Shape {
                path: self.path.into(),
                name: name.into(),
                dtype: tensor.dtype(),
                shape: tensor.shape().to_vec(),
                expected_dtype: dtype,
                expected: shape.to_vec(),
            });
        }
        Ok(tensor.data())
    }

    fn normalisation(&self, config: &ModelConfig) -> Result<Normalisation, WeightsError> {
        let further = config.further_node_features();
        let read = |name: &str, valid: fn(f64) -> bool, reason| {
            let length = if name.starts_with("features") { further } else { config.dimensions };
            if length == 0 {
                return Ok(Vec::new());
            }
            let name = format!("normalisation.{name}");
            let bytes = self.values(&name, Dtype::F64, &[length])?;
            let values: Vec<f64> =
                bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
            if values.iter().all(|&v| valid(v)) {
                Ok(values)
            } else {
                Err(WeightsError::Value { path: self.path.into(), name, reason })
            }
        };
        let mean = |name| read(name, |v| v.is_finite(), "not finite");
        let std = |name| read(name, |v| v > 0.0 && v.is_finite(), "not positive");
        Ok(Normalisation {
            velocity_mean: mean("velocity_mean")?,
            velocity_std: std("velocity_std")?,
            acceleration_mean: mean("acceleration_mean")?,
            acceleration_std: std("acceleration_std")?,
            features_mean: mean("features_mean")?,
            features_std: std("features_std")?,
        })
    }
}
