//! Discs, packings and continuum law as grains shrink: what they cost and how far they are off.

use crate::context::Context;
use crate::studies::sweep::{Case, Family, Measured, Sweep, TruthScene};

/// Sizes of the grains over their default, largest first.
const SIZES: [f64; 3] = [1.0, 0.5, 0.25];
/// The scene: `scenes/truth/column-a1.toml`.
const SCENE: &str = "Column a = 1";

/// The scene with grains of one size.
pub struct GrainSize {
    /// Mean radius, m.
    pub radius: f64,
    /// All models.
    pub sweep: Sweep,
}

/// Estimated time of what is not kept, s.
pub fn estimate(context: &Context) -> f64 {
    cases().map(|(_, case)| case.estimate(context)).sum()
}

/// Runs all models with grains of all sizes.
///
/// # Errors
/// If the discs fail, a file cannot be read or the user interrupts.
pub fn measure(context: &mut Context) -> miette::Result<Vec<GrainSize>> {
    cases()
        .map(|(radius, case)| Ok(GrainSize { radius, sweep: case.measure_solvers(context)? }))
        .collect()
}

/// Wall time (s) that a model takes at a mean radius (m), from its time at another one.
///
/// Steps shrink with the radius. The number of discs of a scene grows as its inverse square; the number
/// of packings, and of discs in them, does not grow.
pub fn extrapolated(measured: &Measured, from: f64, radius: f64) -> f64 {
    measured.seconds * (radius / from).powi(power(measured.family))
}

/// Mean radius (m) under which `packings` are faster than `discs`, by their times at another one.
pub fn crossing(discs: &Measured, packings: &Measured, from: f64) -> f64 {
    let power = power(discs.family) - power(packings.family);
    from * (packings.seconds / discs.seconds).powf(f64::from(power).recip())
}

/// Power of the radius that the work of a model is proportional to.
fn power(family: Family) -> i32 {
    match family {
        Family::Discs | Family::CoarserDiscs => -3,
        Family::Packings => -1,
        Family::Continuum | Family::Network | Family::Ablation => 0,
    }
}

fn cases() -> impl Iterator<Item = (f64, Case)> {
    let scene = TruthScene::named(SCENE);
    let radius = 0.5 * dem::Grains::default().mean_diameter();
    SIZES.into_iter().map(move |size| (size * radius, Case::of_grains(scene, size)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(family: Family, seconds: f64) -> Measured {
        Measured {
            family,
            name: String::new(),
            model: None,
            seconds,
            spread: None,
            comparison: None,
            error: None,
            failure: String::new(),
            warnings: String::new(),
            device: String::new(),
            processor_seconds: None,
            load: None,
        }
    }

    #[test]
    fn models_take_equally_long_where_they_cross() {
        let [discs, packings] = [measured(Family::Discs, 2.0), measured(Family::Packings, 8.0)];
        // 2 (r/r0)^-3 = 8 (r/r0)^-1
        let radius = crossing(&discs, &packings, 1e-3);
        assert!((radius - 0.5e-3).abs() < 1e-12);
        let [a, b] = [&discs, &packings].map(|model| extrapolated(model, 1e-3, radius));
        assert!((a - 16.0).abs() < 1e-9 && (b - 16.0).abs() < 1e-9);
    }
}
