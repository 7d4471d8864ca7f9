//! The longest stable step of the MPM, for each basis and scheme.

use mpm::{
    Basis, Domain, Elastic, ElasticParameters, Numerics, Points, Scheme, Solver, Transfer, Vec2,
    Walls,
};
use rayon::prelude::*;

use super::outcome::Outcome;
use super::study::{Axis, Chart, Curve, Finding, Map, Picture, Study, StudyError};
use super::threshold::{Threshold, bisect, log_range};
use crate::suite::Suite;

pub(super) const BASES: [Basis; 4] = [Basis::Linear, Basis::Gimp, Basis::Quadratic, Basis::Cubic];

const CELL: f64 = 0.1;
const DENSITY: f64 = 1000.0;
const MODULUS: f64 = 1.0e6;
/// A disturbance that grows this much is unstable.
const GROWTH: f64 = 1.0e3;

/// Name as in scene files.
pub(super) fn name(basis: Basis) -> &'static str {
    match basis {
        Basis::Linear => "linear",
        Basis::Gimp => "uGIMP",
        Basis::Quadratic => "quadratic",
        Basis::Cubic => "cubic",
    }
}

/// Time in which a wave crosses a cell (s), `dx / c`.
fn crossing_time(poisson_ratio: f64) -> f64 {
    let law = ElasticParameters { young_modulus: MODULUS, poisson_ratio };
    CELL / (law.wave_modulus() / DENSITY).sqrt()
}

/// Points at rest but for a small disturbance, and what advances them.
struct Body {
    points: Points,
    solver: Solver,
    material: Elastic,
    /// Size of the disturbance: speed (m/s) plus stress over `rho c` (m/s).
    start: f64,
}

impl Body {
    fn new(
        points: Points,
        basis: Basis,
        scheme: Scheme,
        poisson_ratio: f64,
    ) -> Result<Self, StudyError> {
        let numerics = Numerics {
            basis,
            scheme,
            transfer: Transfer::Flip { rate: 0.0 },
            ..Numerics::default()
        };
        let domain = Domain { size: Vec2::new(2.0, 2.0), walls: Walls::default(), cell: CELL };
        let law = ElasticParameters { young_modulus: MODULUS, poisson_ratio };
        let mut body = Self {
            points,
            solver: Solver::new(domain, numerics, Vec2::zeros(), vec![])?,
            material: Elastic::new(law)?,
            start: 0.0,
        };
        body.start = body.size();
        Ok(body)
    }

    fn size(&self) -> f64 {
        let impedance = (MODULUS * DENSITY).sqrt();
        let of_point = |(v, s): (&Vec2, &mpm::Mat2)| v.norm() + s.norm() / impedance;
        self.points.velocity.iter().zip(&self.points.stress).map(of_point).fold(0.0, f64::max)
    }

    fn bound(&self) -> Result<f64, StudyError> {
        Ok(self.solver.stable_step(&self.points, &self.material)?.gershgorin)
    }

    /// Whether the disturbance stays small over some hundred steps. Just beyond the limit, by a
    /// part `e`, it grows by `2 sqrt(2 e)` a step.
    fn stays(&mut self, dt: f64) -> bool {
        (0..400).all(|_| {
            self.solver.advance(&mut self.points, &mut self.material, dt).is_ok()
                && self.size() < GROWTH * self.start
        })
    }

    /// The end of a run that goes on until the solver gives up, if it does not stay stable.
    fn outcome(&mut self, dt: f64) -> Result<Outcome, StudyError> {
        let said = dempm::run::monitor::beyond_bound(dt, self.bound()?);
        if self.stays(dt) {
            return Ok(Outcome::of(None, said));
        }
        let error = (0..4000)
            .find_map(|_| self.solver.advance(&mut self.points, &mut self.material, dt).err());
        let said = error.map(|e| e.to_string()).or(said);
        Ok(Outcome::of(Some("grows without bound".into()), said))
    }
}

/// One point, `xi` cells from a node along x and half a cell along y, under a small stress.
fn single(basis: Basis, xi: f64) -> Result<Body, StudyError> {
    let mut points = Points::default();
    points.push(Vec2::new((10.0 + xi) * CELL, 10.5 * CELL), DENSITY * CELL * CELL, CELL * CELL);
    points.stress[0] = mpm::Mat2::identity();
    // nu = 0: stress along x and y are independent.
    Body::new(points, basis, Scheme::Usl, 0.0)
}

/// Critical step of the single point over `dx / c`: nodes accelerate by `f_i / m_i`, so its stress
/// obeys `s <- (1 - (w dt)²) s` under USL with `w² = c² sum_i (dS_i/dx)² / S_i`, which grows beyond
/// `w dt = sqrt 2`. (The other schemes see no velocity gradient in a single point.)
///
/// For the linear basis `w = c / (dx sqrt(xi (1 - xi)))`: no step is stable at a cell face.
fn single_theory(basis: Basis, xi: f64) -> f64 {
    let along = |x: f64| -> f64 {
        let s = basis.evaluate(10.0 + x);
        let terms = s.value.iter().zip(&s.gradient).take(basis.width());
        terms.filter(|(s, _)| **s > 1.0e-14).map(|(s, g)| g * g / s).sum()
    };
    (2.0 / along(xi).max(along(0.5))).sqrt()
}

/// A block of 100 points, shaken out of their lattice by up to half their spacing, at speeds of
/// 1 nm/s.
fn shaken(basis: Basis, scheme: Scheme) -> Result<Body, StudyError> {
    let mut points =
        Points::rectangle(Vec2::new(0.73, 0.77), Vec2::new(1.23, 1.27), CELL / 2.0, DENSITY);
    for p in 0..points.len() {
        // Low-discrepancy sequence (golden ratio and its square).
        let [a, b] = [0.618_033_988_75, 0.754_877_666_25].map(|r| (p as f64 * r).fract() - 0.5);
        points.position[p] += Vec2::new(a, b) * CELL * 0.25;
        points.velocity[p] = Vec2::new((p as f64).sin(), (p as f64 * 1.7).cos()) * 1.0e-9;
    }
    Body::new(points, basis, scheme, 0.2)
}

/// Critical step of the single point over `dx / c`, measured.
fn single_threshold(basis: Basis, xi: f64, tolerance: f64) -> Threshold {
    let unit = crossing_time(0.0);
    bisect(1.0e-3, 10.0, tolerance, |c| single(basis, xi).is_ok_and(|mut b| b.stays(c * unit)))
}

/// Finds the longest stable step of a single point and of a block, for each basis and scheme.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let tolerance = suite.pick(0.03, 0.005);
    let mut study = Study {
        method: format!(
            "Elastic bodies under FLIP, disturbed by 1e-9; unstable when the disturbance grows by \
             {GROWTH:.0}. Steps in units of dx/c, the time a wave takes through a cell. The solver \
             states a Gershgorin bound in every state; `dempm run` says when the step exceeds it, \
             and a scene whose step exceeds 0.5 dx/c is refused."
        ),
        ..Study::default()
    };
    singles(suite, tolerance, &mut study)?;
    blocks(tolerance, &mut study)?;
    Ok(study)
}

fn singles(suite: Suite, tolerance: f64, study: &mut Study) -> Result<(), StudyError> {
    let unit = crossing_time(0.0);
    let places = suite.pick(8, 20);
    let xi: Vec<f64> = (0..places).map(|k| 0.5 + 0.499 * k as f64 / (places - 1) as f64).collect();
    let curves: Vec<[Curve; 2]> = BASES
        .par_iter()
        .map(|&basis| {
            let measured = xi
                .iter()
                .filter_map(|&x| Some([x, single_threshold(basis, x, tolerance).value()?]));
            let fine = (0..100).map(|k| 0.5 + 0.499 * f64::from(k) / 99.0);
            let theory = fine.map(|x| [x, single_theory(basis, x)]);
            let known = if basis == Basis::Linear { "theory" } else { "" };
            [
                Curve::measured(name(basis), measured.collect()),
                Curve::theory(known, theory.collect()),
            ]
        })
        .collect();
    study.charts.push(Chart {
        title: "Critical step of a single point (USL)".into(),
        x: "place in its cell (0.5: centre, 1: face)".into(),
        y: "critical step, dx/c".into(),
        log: [false, true],
        curves: curves.into_iter().flatten().collect(),
        caption: "Lines: √2/ω with ω² = c² Σ (∂S)²/S, by theory.".into(),
    });
    for basis in BASES {
        for x in [0.5, 0.99] {
            let measured = single_threshold(basis, x, tolerance);
            let beyond = 1.1 * measured.value().unwrap_or(10.0);
            study.findings.push(Finding {
                case: format!("{}, single point at {x} of its cell, USL", name(basis)),
                parameter: "step, dx/c".into(),
                measured,
                theory: Some((single_theory(basis, x), "√2/ω, ω² = c² Σ (∂S)²/S".into())),
                beyond: single(basis, x)?.outcome(beyond * unit)?,
            });
        }
    }
    let steps = log_range(0.03, 3.0, suite.pick(10, 24));
    for basis in BASES {
        let row = |&c: &f64| -> Result<Vec<Outcome>, StudyError> {
            xi.iter().map(|&x| single(basis, x)?.outcome(c * unit)).collect()
        };
        study.maps.push(Map {
            title: format!("Single point, {} basis (USL)", name(basis)),
            x: Axis::new("place in its cell (0.5: centre, 1: face)", xi.clone()),
            y: Axis::new("step, dx/c", steps.clone()),
            outcomes: steps.par_iter().map(row).collect::<Result<_, _>>()?,
            numbers: Vec::new(),
            caption: "Theory: unstable above √2/ω, the reference line of the chart.".into(),
        });
    }
    Ok(())
}

/// Critical step of the shaken block: in units of the solver's bound, and of `dx / c`.
fn block_threshold(
    basis: Basis,
    scheme: Scheme,
    tolerance: f64,
) -> Result<(Threshold, f64), StudyError> {
    let bound = shaken(basis, scheme)?.bound()?;
    let stays = |b: f64| shaken(basis, scheme).is_ok_and(|mut body| body.stays(b * bound));
    Ok((bisect(0.3, 20.0, tolerance, stays), bound / crossing_time(0.2)))
}

fn blocks(tolerance: f64, study: &mut Study) -> Result<(), StudyError> {
    let schemes = [(Scheme::Musl, "MUSL"), (Scheme::Usf, "USF"), (Scheme::Usl, "USL")];
    let cases: Vec<_> = BASES.iter().flat_map(|&b| schemes.map(|s| (b, s))).collect();
    let found: Vec<(Finding, Option<Picture>)> = cases
        .into_par_iter()
        .map(|(basis, (scheme, scheme_name))| {
            let (measured, bound) = block_threshold(basis, scheme, tolerance)?;
            let mut body = shaken(basis, scheme)?;
            let beyond = 1.1 * measured.value().unwrap_or(20.0);
            let outcome = body.outcome(beyond * body.bound()?)?;
            let case = format!("{}, shaken block, {scheme_name}", name(basis));
            let picture = (basis == Basis::Quadratic && scheme == Scheme::Musl).then(|| {
                picture(&body.points, format!("{case}: 10 % beyond the limit, at the end"))
            });
            let theory = (1.0, "at least the bound".into());
            let finding = Finding {
                case: format!("{case} (bound: {bound:.3} dx/c)"),
                parameter: "step, Gershgorin bounds".into(),
                measured,
                theory: Some(theory),
                beyond: outcome,
            };
            Ok((finding, picture))
        })
        .collect::<Result<_, StudyError>>()?;
    for (finding, picture) in found {
        study.findings.push(finding);
        study.pictures.extend(picture);
    }
    Ok(())
}

fn picture(points: &Points, title: String) -> Picture {
    Picture {
        title,
        colour: "speed, m/s".into(),
        position: points.position.iter().map(|&x| x.into()).collect(),
        value: points.velocity.iter().map(|v| v.norm()).collect(),
        radius: vec![0.2 * CELL],
        window: [0.0, 0.0, 2.0, 2.0],
        ..Picture::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A single point is an oscillator of known frequency.
    #[test]
    fn a_single_point_becomes_unstable_where_theory_says() {
        for (basis, xi) in [(Basis::Linear, 0.5), (Basis::Linear, 0.95), (Basis::Quadratic, 0.6)] {
            let measured = single_threshold(basis, xi, 0.005).value().unwrap();
            let theory = single_theory(basis, xi);
            assert!((measured / theory - 1.0).abs() < 0.02, "{measured} against {theory}");
        }
        assert!((single_theory(Basis::Linear, 0.5) - 0.5_f64.sqrt()).abs() < 1e-12);
    }

    /// Whatever happens below the solver's bound is stable.
    #[test]
    fn the_bound_is_below_the_threshold() {
        for scheme in [Scheme::Musl, Scheme::Usl] {
            let (measured, _) = block_threshold(Basis::Quadratic, scheme, 0.1).unwrap();
            assert!(measured.value().unwrap() > 1.0, "{measured}");
        }
    }
}
