//! All weights of a network, or their gradients, as one flat list.

use std::ops::Range;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{Tensor, TensorData};

use super::model::Model;

/// All weights, in the order of the network's fields.
pub fn weights<B: Backend>(model: &Model<B>) -> Vec<f32> {
    let mut read = Read(Vec::new());
    model.visit(&mut read);
    read.0
}

/// The network with other weights, in the order of [`weights`].
pub fn with_weights<B: Backend>(model: Model<B>, weights: &[f32]) -> Model<B> {
    model.map(&mut Write(weights))
}

/// Gradients in the order of [`weights`]; zero for weights that the loss does not depend on.
pub fn gradients<B: AutodiffBackend>(model: &Model<B>, gradients: &B::Gradients) -> Vec<f32> {
    let mut read = ReadGradients::<B> { gradients, values: Vec::new() };
    model.visit(&mut read);
    read.values
}

/// The weights of a hidden linear in the list of all weights, row by row (inputs x outputs).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HiddenMatrix {
    /// Where the list has its first element.
    pub start: usize,
    /// Inputs.
    pub rows: usize,
    /// Outputs.
    pub columns: usize,
}

impl HiddenMatrix {
    /// Where the list has the matrix.
    pub fn range(&self) -> Range<usize> {
        self.start..self.start + self.rows * self.columns
    }
}

/// The weights of all linears between states of a network of this width, in the order of [`weights`]: outputs
/// are as wide as the network, inputs one or several times so.
pub fn hidden_matrices<B: Backend>(model: &Model<B>, width: usize) -> Vec<HiddenMatrix> {
    let mut find = FindHidden { width, next: 0, found: Vec::new() };
    model.visit(&mut find);
    find.found
}

struct FindHidden {
    width: usize,
    /// Where the next parameter starts.
    next: usize,
    found: Vec<HiddenMatrix>,
}

impl<B: Backend> ModuleVisitor<B> for FindHidden {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        let shape = param.val().shape();
        if let [rows, columns] = shape.dims::<D>()[..]
            && columns == self.width
            && rows % self.width == 0
        {
            self.found.push(HiddenMatrix { start: self.next, rows, columns });
        }
        self.next += shape.num_elements();
    }
}

struct Read(Vec<f32>);

impl<B: Backend> ModuleVisitor<B> for Read {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        self.0.extend(param.val().into_data().iter::<f32>());
    }
}

struct ReadGradients<'a, B: AutodiffBackend> {
    gradients: &'a B::Gradients,
    values: Vec<f32>,
}

impl<B: AutodiffBackend> ModuleVisitor<B> for ReadGradients<'_, B> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        let tensor = param.val();
        match tensor.grad(self.gradients) {
            Some(gradient) => self.values.extend(gradient.into_data().iter::<f32>()),
            None => self.values.resize(self.values.len() + tensor.shape().num_elements(), 0.0),
        }
    }
}

struct Write<'a>(&'a [f32]);

impl<B: Backend> ModuleMapper<B> for Write<'_> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        param.map(|old| {
            let (mine, rest) = self.0.split_at(old.shape().num_elements());
            self.0 = rest;
            let data = TensorData::new(mine.to_vec(), old.shape());
            Tensor::from_data(data, &old.device()).set_require_grad(old.is_require_grad())
        })
    }
}
