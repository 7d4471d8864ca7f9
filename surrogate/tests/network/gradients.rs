//! Gradients of all parameters.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{DType, Tensor, TensorData};
use rstest::rstest;

use super::{NonZero, Train, cloud, input, model, small, values, weighted_sum};

#[rstest]
#[case("baseline", 1.0)]
#[case("msg0-hidden1", 1.0)]
#[case("frame4-msg1-hidden1-edgemsg", 1.0)]
#[case("gns", 0.1)] // ReLU: some units rest
fn every_parameter_learns(#[case] name: &str, #[case] share: f64) {
    let config = small(name);
    let positions = cloud(60, 3, 2);
    let model = model::<Train>(&config);
    let output = model.forward(&input(&config, &[(&positions, 60)]));
    assert_eq!(output.dims(), [60, 2]);
    let gradients = weighted_sum(output).backward();
    let mut visitor = NonZero { gradients: &gradients, tensors: 0, share: 1.0 };
    model.visit(&mut visitor);
    assert!(visitor.tensors > 20 && visitor.share >= share, "share {}", visitor.share);
}

/// A tensor of float64 in the shape of another.
fn float64<B: Backend, const D: usize>(values: Vec<f64>, like: &Tensor<B, D>) -> Tensor<B, D> {
    Tensor::from_data(TensorData::new(values, like.dims()), (&like.device(), DType::F64))
}

struct ToFloat64;

impl<B: Backend> ModuleMapper<B> for ToFloat64 {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        param.map(|tensor| float64(values(tensor.clone()), &tensor).require_grad())
    }
}

/// Adds `step` to the parameters along a fixed direction, of tensor number `only`.
struct Nudge {
    only: usize,
    step: f64,
    tensor: usize,
}

/// The direction of a [`Nudge`]: neither 0 nor along any symmetry.
fn direction(length: usize) -> Vec<f64> {
    (0..length).map(|i| (1.0 + i as f64).sin()).collect()
}

impl<B: Backend> ModuleMapper<B> for Nudge {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        self.tensor += 1;
        if self.tensor != self.only + 1 {
            return param;
        }
        param.map(|tensor| {
            let before = values(tensor.clone());
            let along = direction(before.len());
            let after = before.iter().zip(along).map(|(x, d)| x + self.step * d).collect();
            float64(after, &tensor)
        })
    }
}

/// Derivative of the loss along [`direction`], for each parameter tensor.
struct Along<'a> {
    gradients: &'a <Train as AutodiffBackend>::Gradients,
    slopes: Vec<f64>,
}

impl ModuleVisitor<Train> for Along<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<Train, D>>) {
        let gradient = values(param.val().grad(self.gradients).expect("a gradient"));
        let along = direction(gradient.len());
        self.slopes.push(gradient.iter().zip(along).map(|(g, d)| g * d).sum());
    }
}

#[rstest]
fn gradients_are_finite_differences(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
) {
    let config = small(name);
    let positions = cloud(25, 3, 3);
    let mut input = input::<Train>(&config, &[(&positions, 25)]);
    for frame in &mut input.frames {
        frame.nodes = frame.nodes.clone().cast(DType::F64);
        frame.edges = frame.edges.clone().cast(DType::F64);
    }
    let model = model::<Train>(&config).map(&mut ToFloat64);
    let output = model.forward(&input);
    assert_eq!(output.dtype(), DType::F64);
    let gradients = weighted_sum(output).backward();
    let mut along = Along { gradients: &gradients, slopes: Vec::new() };
    model.visit(&mut along);
    let loss = |only, step| {
        let nudged = model.clone().map(&mut Nudge { only, step, tensor: 0 });
        values(weighted_sum(nudged.forward(&input)))[0]
    };
    let step = 1e-6;
    let mut worst: f64 = 0.0;
    for (only, slope) in along.slopes.iter().enumerate() {
        let difference = (loss(only, step) - loss(only, -step)) / (2.0 * step);
        worst = worst.max((difference - slope).abs() / (1.0 + slope.abs()));
    }
    println!("{name}: {} tensors, worst {worst:e}", along.slopes.len());
    assert!(worst < 1e-6, "{worst}");
}
