//! Constitutive laws on a GPU: the twins of `material/`.

use std::sync::Arc;

use cudarc::driver::CudaSlice;
use gpu::{Device, Error, Function, Kernel, Pointer};

use super::drucker_prager::{DruckerPragerLaw, DruckerPragerUpdate};
use super::elastic::ElasticUpdate;
use super::error::CudaError;
use super::memory::upload;
use super::queue::Queue;
use super::source::{defines, source};
use crate::{DruckerPrager, Elastic, MaterialError, Numerics};

/// Constitutive response of all points on a GPU: the twin of [`Material`](crate::Material).
pub trait CudaMaterial {
    /// Queues one step: from `velocity_gradient` to `stress` and `volume` of the solver's points.
    ///
    /// # Errors
    /// A launch was refused.
    fn queue_update(&mut self, queue: &Queue) -> Result<(), CudaError>;

    /// Why a point failed for which a kernel of this material raised `MATERIAL`.
    ///
    /// # Errors
    /// A failure of the device.
    fn failure(&self, point: usize) -> Result<MaterialError, CudaError>;
}

/// The twin of [`Elastic`].
pub struct CudaElastic {
    update: Function<ElasticUpdate>,
    lambda: f64,
    shear_modulus: f64,
}

impl CudaElastic {
    /// Compiles the law.
    ///
    /// # Errors
    /// No compiler.
    pub fn new(device: &Arc<Device>, law: &Elastic) -> Result<Self, Error> {
        let p = law.parameters();
        let update = load_law(device)?;
        Ok(Self { update, lambda: p.lambda(), shear_modulus: p.shear_modulus() })
    }
}

impl CudaMaterial for CudaElastic {
    fn queue_update(&mut self, queue: &Queue) -> Result<(), CudaError> {
        let Self { lambda, shear_modulus, .. } = *self;
        let arguments = ElasticUpdate { m: *queue.mpm, lambda, shear_modulus };
        // SAFETY: one thread a point, and the arrays of the solver.
        unsafe { queue.over_points(&self.update, &arguments) }
    }

    fn failure(&self, point: usize) -> Result<MaterialError, CudaError> {
        Ok(no_failure(point))
    }
}

/// The twin of [`DruckerPrager`].
pub struct CudaDruckerPrager {
    device: Arc<Device>,
    update: Function<DruckerPragerUpdate>,
    law: DruckerPragerLaw,
    volume_strain: CudaSlice<f64>,
}

impl CudaDruckerPrager {
    /// Compiles the law and copies the state of the points to a GPU.
    ///
    /// # Errors
    /// Too little memory; no compiler.
    pub fn new(device: &Arc<Device>, law: &DruckerPrager) -> Result<Self, Error> {
        Ok(Self {
            update: load_law(device)?,
            law: law.parameters().into(),
            volume_strain: upload(device, law.volume_strain())?,
            device: device.clone(),
        })
    }

    /// Copies the state of the points back.
    ///
    /// # Errors
    /// A failure of the device.
    pub fn fetch(&self, law: &mut DruckerPrager) -> Result<(), CudaError> {
        let strain = self.device.stream().clone_dtoh(&self.volume_strain)?;
        let points = law.volume_strain.len();
        law.volume_strain.copy_from_slice(&strain[..points]);
        Ok(())
    }
}

impl CudaMaterial for CudaDruckerPrager {
    fn queue_update(&mut self, queue: &Queue) -> Result<(), CudaError> {
        let volume_strain = Pointer::to(&self.volume_strain, queue.stream);
        let arguments = DruckerPragerUpdate { m: *queue.mpm, law: self.law, volume_strain };
        // SAFETY: one thread and one entry of `volume_strain` a point, and the arrays of the solver.
        unsafe { queue.over_points(&self.update, &arguments) }
    }

    fn failure(&self, point: usize) -> Result<MaterialError, CudaError> {
        Ok(no_failure(point))
    }
}

/// The laws do not depend on the basis; the default one is most likely compiled already.
fn load_law<K: Kernel>(device: &Arc<Device>) -> Result<Function<K>, Error> {
    let module = device.module("mpm.cu", &source(), &defines(&Numerics::default()))?;
    Function::load(device, &module)
}

/// These laws raise no failure of their own.
fn no_failure(point: usize) -> MaterialError {
    MaterialError::Point { point, reason: "this material does not fail by itself".into() }
}
