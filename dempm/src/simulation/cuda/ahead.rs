//! The kernels of a scene, compiled while its packings or discs are prepared.

use dem::cuda::{CudaReal, Room, Shape, assembly_kernels};
use gpu::{Device, Source};
use mpm::Numerics;

use super::rve_material;
use crate::scene::{Material, Precision, Rve, Scene};

/// Starts to compile the kernels that the preparation of a scene and [`CudaSimulation`](super::CudaSimulation) load, and
/// returns at once.
pub(crate) fn compile_ahead(device: &Device, scene: &Scene) {
    let solver = || mpm_source(&scene.numerics);
    match &scene.material {
        Material::Rve(rve) => {
            let response = Source {
                name: "rve_material.cu",
                text: rve_material::source(),
                defines: rve_material::defines(),
            };
            let advance = match rve.precision {
                Precision::F32 => rve_source::<f32>(device, rve, rve.neighbours),
                Precision::F64 => rve_source::<f64>(device, rve, rve.neighbours),
            };
            device.compile_ahead([solver(), response].into_iter().chain(advance));
        }
        // The laws are those of the default numerics.
        Material::MuI(_) | Material::Elastic(_) => {
            device.compile_ahead([solver(), mpm_source(&Numerics::default())]);
        }
        Material::Discs(discs) => {
            // Columns settle awake.
            let kernels = [false, discs.sleep].map(|sleep| match discs.precision {
                Precision::F32 => assembly_kernels::<f32>(&discs.grains, sleep),
                Precision::F64 => assembly_kernels::<f64>(&discs.grains, sleep),
            });
            device.compile_ahead(kernels.into_iter().flatten());
        }
    }
}

fn mpm_source(numerics: &Numerics) -> Source {
    Source { name: "mpm.cu", text: mpm::cuda::source(), defines: mpm::cuda::defines(numerics) }
}

/// `None` where the upload of the packings will be refused.
fn rve_source<R: CudaReal>(device: &Device, rve: &Rve, room: Room) -> Option<Source> {
    let p = &rve.parameters;
    let shape = Shape::new::<R>(p, p.discs, device.limits().ok()?, room).ok()?;
    Some(Source { name: "rve.cu", text: dem::cuda::source::<R>(), defines: shape.defines() })
}
