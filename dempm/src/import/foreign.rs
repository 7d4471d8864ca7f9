//! A trajectory as the other programs keep it.

use ndarray::{Array3, ArrayD, Axis, Ix3};

use super::error::ImportError;

/// Particles over time.
pub(super) struct Foreign {
    /// The file and the trajectory, for messages.
    pub place: String,
    /// Positions of the material, m: frames x particles x 2.
    pub material: Array3<f64>,
    /// Positions of kinematic particles, m: frames x particles x 2.
    pub rigid: Array3<f64>,
}

impl Foreign {
    /// Checks `positions` (frames x particles x 2) and `types`, one for all particles or one each, and
    /// divides the particles into material and `kinematic` ones.
    pub fn new(
        place: String,
        positions: ArrayD<f64>,
        types: &ArrayD<f64>,
        kinematic: impl Fn(f64) -> bool,
    ) -> Result<Self, ImportError> {
        let wrong = |problem: String| ImportError::Shape { place: place.clone(), problem };
        let shape = positions.shape().to_vec();
        let positions = positions.into_dimensionality::<Ix3>().map_err(|_| {
            wrong(format!("positions of shape {shape:?}, expected (frames, particles, 2)"))
        })?;
        let (frames, particles, dimensions) = positions.dim();
        if dimensions != 2 {
            return Err(ImportError::Dimensions { place, found: dimensions });
        }
        if frames < 2 {
            return Err(wrong(format!("{frames} frames, at least 2 are a trajectory")));
        }
        if types.ndim() > 0 && types.shape() != [particles] {
            let found = types.shape();
            return Err(wrong(format!("types of shape {found:?} for {particles} particles")));
        }
        if let Some(index) = positions.iter().position(|x| !x.is_finite()) {
            let (frame, particle) = (index / 2 / particles, index / 2 % particles);
            return Err(ImportError::NotFinite { place, frame, particle });
        }
        let mut types = types.iter().copied().cycle();
        let (mut material, mut rigid) = (Vec::new(), Vec::new());
        for particle in 0..particles {
            match types.next() {
                Some(kind) if kinematic(kind) => rigid.push(particle),
                _ => material.push(particle),
            }
        }
        if material.is_empty() {
            return Err(wrong("no particle that moves freely".to_owned()));
        }
        let [material, rigid] = [material, rigid].map(|some| positions.select(Axis(1), &some));
        Ok(Self { place, material, rigid })
    }
}
