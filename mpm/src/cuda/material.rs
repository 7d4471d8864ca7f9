//! Constitutive laws on a GPU: the twins of `material/`.

use std::sync::Arc;

use cudarc::driver::{CudaFunction, CudaSlice, DeviceRepr};
use gpu::{Device, Error, argument};

use super::error::CudaError;
use super::memory::{address, upload};
use super::solver::Queue;
use super::source::{SOURCE, defines};
use crate::{DruckerPrager, DruckerPragerParameters, Elastic, MaterialError, Numerics};

/// Constitutive response of all points on a GPU: the twin of [`Material`](crate::Material).
pub trait CudaMaterial {
    /// Queues one step: from `velocity_gradient` to `stress` and `volume` of the view.
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
    kernel: CudaFunction,
    lambda: f64,
    shear_modulus: f64,
}

impl CudaElastic {
    /// # Errors
    /// No compiler.
    pub fn new(device: &Arc<Device>, law: &Elastic) -> Result<Self, Error> {
        let p = law.parameters();
        let kernel = load(device, "elastic")?;
        Ok(Self { kernel, lambda: p.lambda(), shear_modulus: p.shear_modulus() })
    }
}

impl CudaMaterial for CudaElastic {
    fn queue_update(&mut self, queue: &Queue) -> Result<(), CudaError> {
        let arguments =
            [argument(queue.view), argument(&self.lambda), argument(&self.shear_modulus)];
        // SAFETY: the arguments of `elastic`.
        unsafe { queue.over_points(&self.kernel, &arguments) }
    }

    fn failure(&self, point: usize) -> Result<MaterialError, CudaError> {
        Ok(never_raised(point))
    }
}

/// The twin of [`DruckerPrager`].
pub struct CudaDruckerPrager {
    device: Arc<Device>,
    kernel: CudaFunction,
    law: DeviceLaw,
    volume_strain: CudaSlice<f64>,
}

impl CudaDruckerPrager {
    /// Copies the state of the points to a GPU.
    ///
    /// # Errors
    /// Too little memory; no compiler.
    pub fn new(device: &Arc<Device>, law: &DruckerPrager) -> Result<Self, Error> {
        Ok(Self {
            kernel: load(device, "drucker_prager")?,
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
        let strain = address(&self.volume_strain, queue.stream);
        let arguments = [argument(queue.view), argument(&self.law), argument(&strain)];
        // SAFETY: the arguments of `drucker_prager`, an entry of `volume_strain` for each point.
        unsafe { queue.over_points(&self.kernel, &arguments) }
    }

    fn failure(&self, point: usize) -> Result<MaterialError, CudaError> {
        Ok(never_raised(point))
    }
}

/// `DruckerPrager` of `drucker_prager.cu`.
#[repr(C)]
#[derive(Clone, Copy)]
struct DeviceLaw {
    bulk_modulus: f64,
    shear_modulus: f64,
    static_friction: f64,
    dynamic_friction: f64,
    inertial_number: f64,
    grain_diameter: f64,
    grain_density: f64,
}

// SAFETY: plain numbers, laid out as in `drucker_prager.cu`.
unsafe impl DeviceRepr for DeviceLaw {}

impl From<&DruckerPragerParameters> for DeviceLaw {
    fn from(p: &DruckerPragerParameters) -> Self {
        Self {
            bulk_modulus: p.bulk_modulus,
            shear_modulus: p.shear_modulus,
            static_friction: p.static_friction,
            dynamic_friction: p.dynamic_friction,
            inertial_number: p.inertial_number,
            grain_diameter: p.grain_diameter,
            grain_density: p.grain_density,
        }
    }
}

/// The laws do not depend on the basis; the default one is most likely compiled already.
fn load(device: &Device, kernel: &str) -> Result<CudaFunction, Error> {
    let module = device.module("mpm.cu", SOURCE, &defines(&Numerics::default()))?;
    Ok(module.load_function(kernel)?)
}

fn never_raised(point: usize) -> MaterialError {
    MaterialError::Point { point, reason: "this material does not fail by itself".into() }
}
