//! What a run takes from the grains at every frame: means over the grains of points, energy and extents.

use gpu::{ConstPointer, Launch, Pointer};
use rayon::prelude::*;

use super::abi::{self, Box, Extent};
use super::energy::{ENERGIES, SUM_THREADS, SumEnergy};
use super::error::CudaAssemblyError;
use super::kernels::COPY_THREADS;
use super::means::{BinGrains, Means, OrderBins};
use super::points::DevicePoints;
use super::state::CudaAssembly;
use crate::assembly::{Assembly, Energy, Members, PointMean, Surroundings};
use crate::cuda::real::CudaReal;
use crate::cuda::shape::WARP;

impl<R: CudaReal> CudaAssembly<R> {
    /// Sets the grains of the points whose means are wanted.
    ///
    /// # Errors
    /// Too little memory.
    ///
    /// # Panics
    /// If a point has no grains.
    pub fn set_points(&mut self, members: &Members) -> Result<(), CudaAssemblyError> {
        // Kernels read the first grain of every point.
        assert_eq!(members.first_empty(), None, "a point without grains");
        self.points = Some(DevicePoints::new(&self.device, members, self.output.len())?);
        Ok(())
    }

    /// Queues that the means over the grains of the [points](Self::set_points), for
    /// [`point_means`](Self::point_means), are copied to the host, with the energy of the grains of `assembly`, which
    /// was uploaded, and their [extents](Self::extents); where `states` are kept, as
    /// [`queue_states`](Self::queue_states) too.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn queue_means(
        &mut self,
        assembly: &Assembly<R>,
        around: &Surroundings,
        states: bool,
    ) -> Result<(), CudaAssemblyError> {
        if states {
            self.queue_states()?;
        } else {
            self.write_output()?;
        }
        let stream = self.device.stream().clone();
        let Some(points) = &self.points else {
            self.fetch = Some(stream.record_event(None)?);
            return Ok(());
        };
        let (a, p) = (self.arrays(), self.p);
        let grains = self.output.len() as u32;
        let grain = ConstPointer::to(&self.output, &stream);
        // Free between two sequences of steps, as are the bins.
        stream.memset_zeros(&mut self.start)?;
        let count = Pointer::to(&self.start, &stream);
        let corner = |[min, max]: &[[f64; 2]; 2]| Box { min: *min, max: *max };
        let boxes: Vec<Box> = around.boxes.iter().map(corner).collect();
        let on_device = self.device.upload(&boxes)?;
        let around = abi::Surroundings {
            size: around.size,
            gravity: assembly.gravity,
            thickness: around.thickness,
            width: around.width,
            mass_scale: assembly.grains.mass_scale,
            boxes: boxes.len() as u32,
            unused: 0,
        };
        let means = Means {
            a,
            p,
            around,
            boxes: ConstPointer::to(&on_device, &stream),
            grain,
            count: count.into(),
            start: ConstPointer::to(&points.start, &stream),
            member: ConstPointer::to(&points.member, &stream),
            points: points.mean.len() as u32,
            mean: Pointer::to(&points.mean, &stream),
        };
        let energy = Pointer::to(&points.energy, &stream);
        let extent = Pointer::to(&points.extent, &stream);
        let per_grain = |threads| Launch::each(grains as usize, threads);
        let per_bin = Launch::each(self.grid.count(), COPY_THREADS);
        let per_point = Launch::each(WARP * points.mean.len(), COPY_THREADS);
        let k = &self.kernels;
        // SAFETY: arrays are as long as the numbers of grains, bins and points say, and members are grains.
        unsafe {
            let bins = BinGrains { a, p, grain, grains, count, extent };
            k.bin_grains.launch(&stream, per_grain(COPY_THREADS), &bins)?;
            k.order_bins.launch(&stream, per_bin, &OrderBins { a, p, count: count.into() })?;
            k.means.launch(&stream, per_point, &means)?;
            let sums = SumEnergy { p, around, grain, grains, energy };
            k.energy.launch(&stream, per_grain(SUM_THREADS), &sums)?;
        }
        if let Some(points) = &mut self.points {
            stream.memcpy_dtoh(&points.mean, &mut points.fetched)?;
            stream.memcpy_dtoh(&points.energy, &mut points.fetched_energy)?;
            stream.memcpy_dtoh(&points.extent, &mut points.fetched_extents)?;
        }
        self.fetch = Some(stream.record_event(None)?);
        Ok(())
    }

    /// The means over the grains of all points that were last fetched, and the energy.
    ///
    /// # Errors
    /// The device failed.
    pub fn point_means(&self) -> Result<(Vec<PointMean>, Energy), CudaAssemblyError> {
        let mut energy = Energy { losses: self.losses, ..Energy::default() };
        let Some(points) = &self.points else { return Ok((Vec::new(), energy)) };
        for block in points.fetched_energy.as_slice()?.chunks(ENERGIES) {
            energy.kinetic += block[0];
            energy.potential += block[1];
            energy.elastic += block[2];
        }
        Ok((points.fetched.as_slice()?.iter().map(PointMean::from).collect(), energy))
    }

    /// Horizontal position (m) and radius (m) of each grain, as of the means that were last fetched. `assembly` is the
    /// one that was uploaded.
    ///
    /// # Errors
    /// The device failed.
    pub fn extents(
        &self,
        assembly: &Assembly<R>,
    ) -> Result<impl IndexedParallelIterator<Item = (f64, f64)>, CudaAssemblyError> {
        let region = assembly.region;
        let fetched: &[Extent<R>] = match &self.points {
            Some(points) => points.fetched_extents.as_slice()?,
            None => &[],
        };
        let extent = move |e: &Extent<R>| (region.decode::<R>([e.x, e.x])[0], e.r.to_f64());
        Ok(fetched.par_iter().map(extent))
    }
}
