//! An implementation in numpy.

use std::path::Path;
use std::process::Command;

use rstest::rstest;
use safetensors::tensor::{Dtype, TensorView};

use super::{Cpu, cloud, input, saved, small, values};

/// Writes a network, its input and output, which `numpy_forward.py` computes from the names and
/// shapes that docs/weights.md promises.
#[rstest]
fn numpy_gets_the_same_accelerations(
    #[values("baseline", "msg0-hidden1", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
) {
    let python = |arguments: &[&str]| Command::new("python3").args(arguments).output();
    if !python(&["-c", "import numpy, safetensors.numpy"]).is_ok_and(|o| o.status.success()) {
        println!("skipped: python3 has no numpy or no safetensors");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let config = small(name);
    let model = saved(&path, &config);
    let positions = cloud(50, 3, 13);
    let input = input::<Cpu>(&config, &[(&positions, 50)]);
    let mut tensors: Vec<(String, Vec<usize>, Vec<u8>)> = Vec::new();
    let mut push = |name: String, shape: &[usize], values: Vec<f64>| {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        tensors.push((name, shape.to_vec(), bytes));
    };
    for (k, frame) in input.frames.iter().enumerate() {
        push(format!("nodes{k}"), &frame.nodes.dims(), values(frame.nodes.clone()));
        push(format!("edges{k}"), &frame.edges.dims(), values(frame.edges.clone()));
        let edges = frame.sender.dims();
        push(format!("sender{k}"), &edges, values(frame.sender.clone().float()));
        push(format!("receiver{k}"), &edges, values(frame.receiver.clone().float()));
    }
    let output = model.forward(&input);
    push("output".into(), &output.dims(), values(output));
    let views = tensors.iter().map(|(name, shape, data)| {
        (name, TensorView::new(Dtype::F64, shape.clone(), data).unwrap())
    });
    let example = folder.path().join("example.safetensors");
    safetensors::serialize_to_file(views, None, &example).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/numpy_forward.py");
    let arguments = [&script, &path, &example].map(|p| p.to_str().unwrap());
    let result = python(&arguments).unwrap();
    let text = String::from_utf8_lossy(&result.stdout);
    assert!(result.status.success(), "{text}{}", String::from_utf8_lossy(&result.stderr));
    println!("{name}: {text}");
    assert!(text.trim().parse::<f64>().unwrap() < 1e-5, "{text}");
}
