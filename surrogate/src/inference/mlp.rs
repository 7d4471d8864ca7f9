//! Multilayer perceptrons on blocks of rows that stay in the CPU's cache.

use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};
use gemm::Parallelism;
use multiversion::multiversion;
use rayon::prelude::*;

use crate::network;

/// Rows of a block.
const ROWS: usize = 128;
/// Epsilon of LayerNorm, Burn's default.
const EPSILON: f32 = 1e-5;

/// A row-major matrix, inputs x outputs, and a bias.
struct Linear {
    weight: Vec<f32>,
    bias: Vec<f32>,
}

/// Twin of [`network::Mlp`].
pub(super) struct Mlp {
    linears: Vec<Linear>,
    /// Scale and shift of the LayerNorm.
    norm: Option<[Vec<f32>; 2]>,
    slope: f32,
}

/// Activations of a block of rows.
#[derive(Default)]
pub(super) struct Block {
    /// Result of the last function, rows x width.
    pub values: Vec<f32>,
    other: Vec<f32>,
}

fn numbers<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f32> {
    let data: TensorData = tensor.into_data();
    data.iter::<f32>().collect()
}

impl Mlp {
    pub fn new<B: Backend>(mlp: &network::Mlp<B>, slope: f64) -> Self {
        let linears = mlp
            .linears
            .iter()
            .map(|linear| {
                let weight = linear.weight.val();
                let [_, outputs] = weight.dims();
                let bias = linear.bias.as_ref().map(|bias| numbers(bias.val()));
                Linear { weight: numbers(weight), bias: bias.unwrap_or(vec![0.0; outputs]) }
            })
            .collect();
        let norm = mlp.norm.as_ref().map(|norm| {
            let scale = numbers(norm.gamma.val());
            let shift = norm.beta.as_ref().map(|beta| numbers(beta.val()));
            let shift = shift.unwrap_or(vec![0.0; scale.len()]);
            [scale, shift]
        });
        Self { linears, norm, slope: slope as f32 }
    }

    /// Outputs of the first linear layer.
    pub fn width(&self) -> usize {
        self.linears[0].bias.len()
    }

    pub fn first_bias(&self) -> &[f32] {
        &self.linears[0].bias
    }

    /// Adds the product of the first linear layer with some input columns, from column `first` on, to
    /// `block`; `input` has `rows` rows.
    pub fn add_first(&self, first: usize, input: &[f32], rows: usize, block: &mut [f32]) {
        let columns = input.len() / rows.max(1);
        let width = self.width();
        add_product(input, &self.linears[0].weight[first * width..], [rows, columns, width], block);
    }

    /// Replaces the output of the first linear layer in `block` by that of the whole MLP.
    pub fn after_first(&self, rows: usize, block: &mut Block) {
        for linear in &self.linears[1..] {
            leaky_relu(&mut block.values, self.slope);
            let [inputs, outputs] = [linear.weight.len() / linear.bias.len(), linear.bias.len()];
            fill_rows(&mut block.other, rows, &linear.bias);
            add_product(&block.values, &linear.weight, [rows, inputs, outputs], &mut block.other);
            std::mem::swap(&mut block.values, &mut block.other);
        }
        if let Some([scale, shift]) = &self.norm {
            layer_norm(&mut block.values, scale, shift);
        }
    }

    /// Outputs (rows x outputs) of inputs whose columns are those of `parts` side by side.
    pub fn forward(&self, parts: &[&[f32]], rows: usize) -> Vec<f32> {
        let outputs = self.linears[self.linears.len() - 1].bias.len();
        let mut out = vec![0.0; rows * outputs];
        let blocks = out.par_chunks_mut(ROWS * outputs).enumerate();
        blocks.for_each_init(Block::default, |block, (number, out)| {
            let rows_here = out.len() / outputs;
            fill_rows(&mut block.values, rows_here, self.first_bias());
            let mut first = 0;
            for part in parts {
                let columns = part.len() / rows;
                let part = &part[number * ROWS * columns..][..rows_here * columns];
                self.add_first(first, part, rows_here, &mut block.values);
                first += columns;
            }
            self.after_first(rows_here, block);
            out.copy_from_slice(&block.values);
        });
        out
    }
}

/// `rows` copies of a row.
pub(super) fn fill_rows(values: &mut Vec<f32>, rows: usize, row: &[f32]) {
    values.clear();
    (0..rows).for_each(|_| values.extend_from_slice(row));
}

/// `out += a b` for matrices `a` (rows x inner) and `b` (inner x columns, or more rows).
fn add_product(a: &[f32], b: &[f32], [rows, inner, columns]: [usize; 3], out: &mut [f32]) {
    assert!(a.len() >= rows * inner && b.len() >= inner * columns && out.len() >= rows * columns);
    // SAFETY: the matrices are row-major and at least as large as the sizes say.
    unsafe {
        gemm::gemm(
            rows,
            columns,
            inner,
            out.as_mut_ptr(),
            1,
            columns as isize,
            true,
            a.as_ptr(),
            1,
            inner as isize,
            b.as_ptr(),
            1,
            columns as isize,
            1.0_f32,
            1.0_f32,
            false,
            false,
            false,
            Parallelism::None,
        );
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2+fma"))]
fn leaky_relu(values: &mut [f32], slope: f32) {
    for x in values {
        // The slope is at most 1. A NaN stays one, as both sides are.
        *x = x.max(slope * *x);
    }
}

/// Lanes of a sum, which fill vector registers.
const LANES: usize = 16;

#[inline(always)]
fn sum(values: &[f32], term: impl Fn(f32) -> f32) -> f32 {
    let mut lanes = [0.0; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    for chunk in chunks {
        for (lane, x) in lanes.iter_mut().zip(chunk) {
            *lane += term(*x);
        }
    }
    lanes.iter().sum::<f32>() + rest.iter().map(|x| term(*x)).sum::<f32>()
}

/// (x - mean) / sqrt(variance + epsilon) * scale + shift of every row.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2+fma"))]
fn layer_norm(values: &mut [f32], scale: &[f32], shift: &[f32]) {
    let width = scale.len();
    for row in values.chunks_exact_mut(width) {
        let mean = sum(row, |x| x) / width as f32;
        let variance = sum(row, |x| (x - mean) * (x - mean)) / width as f32;
        let factor = 1.0 / (variance + EPSILON).sqrt();
        for ((x, scale), shift) in row.iter_mut().zip(scale).zip(shift) {
            *x = (*x - mean) * factor * scale + shift;
        }
    }
}
