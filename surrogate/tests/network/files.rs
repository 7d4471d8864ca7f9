//! Files of weights.

use std::collections::BTreeMap;
use std::path::Path;

use burn::module::{Module, ModuleVisitor, Param};
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rstest::rstest;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use surrogate::features::Normalisation;
use surrogate::network::weights::WeightsError;
use surrogate::network::{Model, ModelConfig, NodeFeature, weights};

use super::{Cpu, NonZero, Train, cloud, input, model, normalisation, saved, small, weighted_sum};

fn load(path: &Path) -> Result<Model<Cpu>, WeightsError> {
    weights::load(path, &Default::default()).map(|loaded| loaded.0)
}

/// All parameters in order.
#[derive(Default)]
struct Bits(Vec<u32>);

impl<B: Backend> ModuleVisitor<B> for Bits {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        self.0.extend(param.val().into_data().iter::<f32>().map(f32::to_bits));
    }
}

fn bits<B: Backend>(model: &Model<B>) -> Vec<u32> {
    let mut bits = Bits::default();
    model.visit(&mut bits);
    bits.0
}

/// Any flipped bit is found: in the header, in the metadata and in the tensors.
#[test]
fn damaged_weights_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    saved(&path, &small("baseline"));
    let whole = std::fs::read(&path).unwrap();
    let header = 8 + u64::from_le_bytes(whole[..8].try_into().unwrap()) as usize;
    let places = (0..header).step_by(7).chain((header..whole.len()).step_by(whole.len() / 200));
    for place in places {
        let mut damaged = whole.clone();
        damaged[place] ^= 1 << (place % 8);
        std::fs::write(&path, damaged).unwrap();
        assert!(load(&path).is_err(), "byte {place} of {}", whole.len());
    }
    std::fs::write(&path, whole).unwrap();
    load(&path).unwrap();
}

#[rstest]
fn weights_survive_a_file_to_the_bit(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let config = ModelConfig { connection_radius: 0.1 + 0.2, ..small(name) };
    let model = saved(&path, &config);
    let (loaded, loaded_config, norm, extra) =
        weights::load::<Train>(&path, &Default::default()).unwrap();
    assert_eq!(bits(&loaded), bits(&model));
    assert_eq!((loaded_config, norm), (config.clone(), normalisation()));
    assert_eq!(extra["step"], "12");
    // A loaded network learns.
    let positions = cloud(30, 3, 2);
    let output = loaded.forward(&input(&config, &[(&positions, 30)]));
    let gradients = weighted_sum(output).backward();
    let mut visitor = NonZero { gradients: &gradients, tensors: 0, share: 1.0 };
    loaded.visit(&mut visitor);
    assert!(visitor.tensors > 20);
    // Files are the same to the byte.
    let again = folder.path().join("again.safetensors");
    saved(&again, &config);
    assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(&again).unwrap());
}

#[test]
fn further_features_survive_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let features = vec![NodeFeature::Overburden, NodeFeature::InitialStress];
    let config = ModelConfig { node_features: features, ..small("baseline") };
    let norm = Normalisation {
        features_mean: vec![0.1, 0.2, 0.3],
        features_std: vec![1.0, 2.0, 3.0],
        ..normalisation()
    };
    weights::save(&path, &model::<Cpu>(&config), &config, &norm, BTreeMap::new()).unwrap();
    let (_, loaded, found, _) = weights::load::<Cpu>(&path, &Default::default()).unwrap();
    assert_eq!((loaded, found), (config, norm));
}

/// Older programs know neither surfaces nor material; files of networks without them are as they were.
#[rstest]
#[case(vec![NodeFeature::Acceleration], 1)]
#[case(vec![NodeFeature::Surfaces], 2)]
#[case(vec![NodeFeature::Acceleration, NodeFeature::Material], 2)]
fn new_features_have_a_format_of_their_own(
    #[case] features: Vec<NodeFeature>,
    #[case] format: usize,
) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let config = ModelConfig { node_features: features, ..small("baseline") };
    let columns = config.further_node_features();
    let norm = Normalisation {
        features_mean: vec![0.1; columns],
        features_std: vec![2.0; columns],
        ..normalisation()
    };
    weights::save(&path, &model::<Cpu>(&config), &config, &norm, BTreeMap::new()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let header = String::from_utf8_lossy(&bytes[..2000]);
    assert!(header.contains(&format!("\\\"format\\\":{format},")), "{header}");
    let (_, loaded, found, _) = weights::load::<Cpu>(&path, &Default::default()).unwrap();
    assert_eq!((loaded, found), (config, norm));
}

#[test]
fn a_normalisation_that_divides_by_zero_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let config = small("baseline");
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let norm = Normalisation { velocity_std: vec![0.1, wrong], ..normalisation() };
        weights::save(&path, &model::<Cpu>(&config), &config, &norm, BTreeMap::new()).unwrap();
        assert!(matches!(load(&path), Err(WeightsError::Value { .. })), "{wrong}");
    }
}

#[test]
fn damaged_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    assert!(matches!(load(&path), Err(WeightsError::Io { .. })));
    saved(&path, &small("baseline"));
    let whole = std::fs::read(&path).unwrap();
    let check = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        load(&path)
    };
    for length in (0..whole.len()).step_by(whole.len() / 97) {
        assert!(matches!(check(&whole[..length]), Err(WeightsError::Format { .. })), "{length}");
    }
    check(b"not a safetensors file at all").unwrap_err();
    // Any damage to the header is an error or harmless, never a panic.
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let header = 8 + u64::from_le_bytes(whole[..8].try_into().unwrap()) as usize;
    for _ in 0..400 {
        let mut bytes = whole.clone();
        bytes[rng.random_range(0..header)] = rng.random();
        let _ = check(&bytes);
    }
    check(&whole).unwrap();
}

/// Name, type and shape of a tensor of a rewritten file.
type Header = (String, Dtype, Vec<usize>);

/// Rewrites a weights file with other metadata and tensors; `F64` keeps a tensor's type.
fn rewrite(
    path: &Path,
    metadata: impl Fn(&str) -> Option<String>,
    tensor: impl Fn(&str, Vec<usize>) -> Option<Header>,
) {
    let bytes = std::fs::read(path).unwrap();
    let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
    let json = metadata(&header.metadata().as_ref().unwrap()["surrogate"]);
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let views: Vec<_> = file
        .iter()
        .filter_map(|(name, view)| {
            let (new, dtype, shape) = tensor(name, view.shape().to_vec())?;
            let dtype = if dtype == Dtype::F64 { view.dtype() } else { dtype };
            Some((new, TensorView::new(dtype, shape, view.data()).unwrap()))
        })
        .collect();
    let metadata = json.map(|json| [("surrogate".to_string(), json)].into());
    let written = safetensors::serialize(views, metadata).unwrap();
    std::fs::write(path, written).unwrap();
}

#[test]
fn wrong_tensors_are_errors_that_name_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let same = |json: &str| Some(json.to_string());
    let weight = "node_fusion.linears.0.weight";
    let kept = |name: &str, shape| Some((name.to_string(), Dtype::F64, shape));
    let check = |metadata: &dyn Fn(&str) -> Option<String>,
                 tensor: &dyn Fn(&str, Vec<usize>) -> Option<Header>| {
        saved(&path, &small("baseline"));
        rewrite(&path, metadata, tensor);
        load(&path).map(drop)
    };
    check(&same, &kept).unwrap();
    let transposed = |name: &str, mut shape: Vec<usize>| {
        if name == weight {
            shape.reverse();
        }
        kept(name, shape)
    };
    let error = check(&same, &transposed).unwrap_err();
    assert!(matches!(&error, WeightsError::Shape { name, .. } if name == weight), "{error}");
    let renamed = |name: &str, shape| kept(if name == weight { "other" } else { name }, shape);
    let error = check(&same, &renamed).unwrap_err();
    assert!(matches!(&error, WeightsError::Missing { name, .. } if name == weight), "{error}");
    let dropped = |name: &str, shape| if name == weight { None } else { kept(name, shape) };
    assert!(matches!(check(&same, &dropped), Err(WeightsError::Size { .. })));
    let unnamed = |name: &str, shape| kept(name, shape).filter(|_| !name.contains("velocity_std"));
    assert!(matches!(check(&same, &unnamed), Err(WeightsError::Missing { .. })));
    let integers = |name: &str, shape: Vec<usize>| {
        let dtype = if name.starts_with("normalisation") { Dtype::I64 } else { Dtype::F64 };
        Some((name.to_string(), dtype, shape))
    };
    assert!(matches!(check(&same, &integers), Err(WeightsError::Shape { .. })));
    assert!(matches!(check(&|_| None, &kept), Err(WeightsError::Metadata { .. })));
    let garbage = |_: &str| Some("{}".to_string());
    assert!(matches!(check(&garbage, &kept), Err(WeightsError::Metadata { .. })));
    let newer = |json: &str| Some(json.replace("\"format\":1", "\"format\":3"));
    assert!(matches!(check(&newer, &kept), Err(WeightsError::Metadata { .. })));
    let wider = |json: &str| Some(json.replace("\"width\":8", "\"width\":4096"));
    assert!(matches!(check(&wider, &kept), Err(WeightsError::Size { .. })));
    let absurd = |json: &str| Some(json.replace("\"width\":8", "\"width\":9999999999"));
    assert!(matches!(check(&absurd, &kept), Err(WeightsError::Config { .. })));
}
