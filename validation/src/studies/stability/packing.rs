//! Packings of several studies, from the solver's cache on disk.

use dem::{Packing, Real, RveParameters};

use super::study::{Picture, StudyError};

/// A consolidated packing.
pub fn consolidated(p: &RveParameters, seed: u64) -> Result<Packing<f64>, StudyError> {
    let ladders = dempm::packings::ladders(p, &[seed], &[], 9.81)?;
    Ok(ladders.into_iter().next().expect("one seed, one packing").isotropic)
}

/// The discs of a packing, coloured by their peculiar speed.
pub fn picture<R: Real>(packing: &Packing<R>, title: String) -> Picture {
    let discs = packing.plain_discs();
    let position: Vec<[f64; 2]> = discs.iter().map(|d| d.x).collect();
    let end = |k: usize, pick: fn(f64, f64) -> f64, start: f64| {
        position.iter().map(|x| x[k]).fold(start, pick)
    };
    let margin = discs.iter().map(|d| d.r).fold(0.0, f64::max);
    let speed = |u: &[R; 2]| u[0].to_f64().hypot(u[1].to_f64());
    Picture {
        title,
        colour: "speed, m/s".into(),
        value: packing.discs.iter().map(|d| speed(&d.u)).collect(),
        radius: discs.iter().map(|d| d.r).collect(),
        window: [
            end(0, f64::min, f64::MAX) - margin,
            end(1, f64::min, f64::MAX) - margin,
            end(0, f64::max, f64::MIN) + margin,
            end(1, f64::max, f64::MIN) + margin,
        ],
        position,
        ..Picture::default()
    }
}
