//! Means over the grains of points: `means.cu`.

use gpu::{ConstPointer, Pointer, kernel};
use nalgebra::{Matrix2, Vector2};

use super::abi::{self, Arrays, Box, Extent, Output, Parameters};
use crate::assembly::PointMean;
use crate::cuda::real::CudaReal;

kernel! {
    /// Puts every grain into its bin, and writes its extent.
    pub(super) struct BinGrains<R: CudaReal>: assembly_mean_bins {
        /// The bins.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// States of the grains.
        pub grain: ConstPointer<Output<R>>,
        /// Number of grains.
        pub grains: u32,
        /// Grains in each bin, from zero.
        pub count: Pointer<u32>,
        /// Extent of each grain.
        pub extent: Pointer<Extent<R>>,
    }

    /// Sorts the grains of every bin by identity.
    pub(super) struct OrderBins<R: CudaReal>: assembly_mean_order {
        /// The bins.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// Grains in each bin.
        pub count: ConstPointer<u32>,
    }

    /// Means over the grains of each point, by one warp.
    pub(super) struct Means<R: CudaReal>: assembly_means {
        /// The bins.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// What surrounds the grains.
        pub around: abi::Surroundings,
        /// Boxes in the domain.
        pub boxes: ConstPointer<Box>,
        /// States of the grains.
        pub grain: ConstPointer<Output<R>>,
        /// Grains in each bin.
        pub count: ConstPointer<u32>,
        /// Where the grains of each point begin.
        pub start: ConstPointer<u32>,
        /// Grains point by point.
        pub member: ConstPointer<u32>,
        /// Number of points.
        pub points: u32,
        /// Mean of each point.
        pub mean: Pointer<abi::PointMean>,
    }
}

impl From<&abi::PointMean> for PointMean {
    fn from(mean: &abi::PointMean) -> Self {
        Self {
            position: Vector2::from(mean.position),
            velocity: Vector2::from(mean.velocity),
            mass: mean.mass,
            volume: mean.volume,
            velocity_gradient: Matrix2::from_row_slice(&mean.velocity_gradient),
            stress: Matrix2::from_row_slice(&mean.stress),
            solid_fraction: mean.solid_fraction,
            coordination: mean.coordination,
        }
    }
}
