//! The DEM step against 2 / omega: lattices with known spectra, packings, dashpots.

use dem::element::Element;
use dem::{Cell, Grains, Packing, PlainDisc, RveParameters};
use nalgebra::Matrix2;
use rayon::prelude::*;

use super::outcome::Outcome;
use super::packing::{consolidated, picture};
use super::study::{Axis, Finding, Map, Picture, Study, StudyError};
use super::threshold::{Threshold, bisect};
use crate::suite::Suite;
use crate::text::number;

const RADIUS: f64 = 3.75e-3;
/// A packing whose kinetic energy is more than this part of its elastic energy is not at rest.
const HEAT: f64 = 0.01;

/// Equal discs that only touch: linear springs, without dashpot.
fn linear() -> RveParameters {
    RveParameters {
        grains: Grains {
            radius_min: RADIUS,
            radius_max: RADIUS,
            damping_ratio: 0.0,
            ..Grains::default()
        },
        free_solid_fraction: 0.0,
        thin_width: 0.0,
        ..RveParameters::default()
    }
}

/// Distance of neighbours in a lattice: so little pressed together that it cannot buckle in time.
const DISTANCE: f64 = 1.9999 * RADIUS;
/// Steps of a lattice; its fastest mode grows by a quarter a step 1 % beyond the limit.
const LATTICE_STEPS: usize = 400;

/// A periodic chain of two discs that just touch, disturbed.
///
/// Each disc touches both images of the other, so sliding along the chain has `w² = 4 kn / m`, and
/// with sticking contacts the spins in phase have `w² = 8 kt / m`.
fn chain(p: &RveParameters) -> Packing<f64> {
    let distance = DISTANCE;
    let cell = Cell { h: Matrix2::new(2.0 * distance, 0.0, 0.0, 10.0 * RADIUS) };
    let discs =
        [0.25, 0.75].map(|s| PlainDisc { x: [s * 2.0 * distance, 5.0 * RADIUS], r: RADIUS });
    disturbed(Packing::new(cell, &discs, |r| p.grains.disc_mass(r)))
}

/// A hexagonal lattice of 4 x 4 discs that just touch, disturbed. With
/// sticking contacts its spins in phase, `w² = 24 kt / m`, are its fastest mode.
fn hexagonal(p: &RveParameters) -> Packing<f64> {
    let d = DISTANCE;
    let row = d * 0.75_f64.sqrt();
    let cell = Cell { h: Matrix2::new(4.0 * d, 0.0, 0.0, 4.0 * row) };
    let place = |k: usize| {
        let (i, j) = (k % 4, k / 4);
        PlainDisc { x: [(i as f64 + 0.5 * (j % 2) as f64) * d, j as f64 * row], r: RADIUS }
    };
    let discs: Vec<PlainDisc> = (0..16).map(place).collect();
    disturbed(Packing::new(cell, &discs, |r| p.grains.disc_mass(r)))
}

/// Velocities of 0.1 µm/s and spins of the same speed at the rim, different for every disc.
fn disturbed(mut packing: Packing<f64>) -> Packing<f64> {
    for (k, disc) in packing.discs.iter_mut().enumerate() {
        let k = k as f64;
        disc.u = [1.0e-7 * (1.0 + k).sin(), 0.0];
        disc.w = 1.0e-7 / RADIUS * (1.0 + 0.3 * (2.3 * k).sin());
    }
    packing
}

/// A packing at rest in a fixed cell for some time at one step factor.
struct Rest {
    element: Element<f64>,
    /// Elastic energy at the start (J).
    elastic: f64,
}

impl Rest {
    fn new(packing: Packing<f64>, p: &RveParameters, factor: f64) -> Result<Self, StudyError> {
        // Rounded, for messages that quote it.
        let step_factor = (1.0e3 * factor).round() / 1.0e3;
        let p = RveParameters { grains: Grains { step_factor, ..p.grains }, ..p.clone() };
        let element = Element::new(packing, &p, p.grains.step())?;
        let packing = &element.rve.packing;
        let elastic = packing.elastic_energy(&p.grains);
        Ok(Self { element, elastic })
    }

    /// Kinetic energy over the elastic energy of the start.
    fn heat(&self) -> f64 {
        self.element.rve.packing.kinetic_energy() / self.elastic
    }

    /// Steps until something is wrong: symptom, and what the DEM said.
    fn run(&mut self, steps: usize) -> (Option<String>, Option<String>) {
        for n in 0..steps {
            if let Err(error) = self.element.advance(&Matrix2::zeros()) {
                return (Some(format!("blows up at step {n}")), Some(error.to_string()));
            }
            if n % 50 == 49 && self.heat() > HEAT {
                return (Some(format!("shakes itself within {n} steps")), None);
            }
        }
        (None, None)
    }

    /// The outcome of [`run`](Self::run), with the errors and warnings of a scene with this step.
    fn outcome(&mut self, steps: usize) -> Outcome {
        let (symptom, _) = self.run(steps);
        // Unstable, it is left running, to hear whether the DEM says something.
        let error = symptom
            .is_some()
            .then(|| (0..20 * steps).find_map(|_| self.element.advance(&Matrix2::zeros()).err()));
        let error = error.flatten().map(|e| e.to_string());
        Outcome::of(symptom, error.or_else(|| refused(&self.element.parameters)))
    }
}

/// The packing after it has come to rest with sticking contacts: crystals of equal discs, prepared
/// with friction, rearrange for a while at any step.
fn relaxed(packing: Packing<f64>, p: &RveParameters) -> Result<Packing<f64>, StudyError> {
    let p = RveParameters {
        grains: Grains { friction: 1e6, damping_ratio: 0.5, ..p.grains },
        ..p.clone()
    };
    let mut element = Rest::new(packing, &p, 0.1)?.element;
    for _ in 0..10_000 {
        element.advance(&Matrix2::zeros())?;
    }
    Ok(element.rve.packing)
}

/// Errors or warnings of a scene with this contact law and step.
fn refused(p: &RveParameters) -> Option<String> {
    super::scene_messages::said(&format!(
        "duration = 0.1\n[domain]\nsize = [4.0, 2.0]\n[[column]]\nsize = [1.0, 1.0]\n\
         [material]\nkind = \"rve\"\n[grains]\nstep_factor = {:?}\ndamping_ratio = {:?}\n\
         radius_min = {:?}\nradius_max = {:?}\n",
        p.grains.step_factor, p.grains.damping_ratio, p.grains.radius_min, p.grains.radius_max
    ))
}

/// Critical step over `sqrt(m_min / kn)`.
fn critical(packing: &Packing<f64>, p: &RveParameters, tolerance: f64) -> Threshold {
    let stays = |factor: f64| {
        let steps = if packing.discs.len() < 50 { LATTICE_STEPS } else { 3000 };
        Rest::new(packing.clone(), p, factor).is_ok_and(|mut rest| rest.run(steps).0.is_none())
    };
    bisect(0.1, 3.0, tolerance, stays)
}

/// A case: name, parameters, packing and theory.
type Case = (&'static str, RveParameters, Packing<f64>, Option<(f64, &'static str)>);

fn cases(suite: Suite) -> Result<Vec<Case>, StudyError> {
    let smooth = RveParameters { grains: Grains { friction: 0.0, ..linear().grains }, ..linear() };
    let sticking =
        RveParameters { grains: Grains { friction: 1e6, ..linear().grains }, ..linear() };
    let random = RveParameters { discs: suite.pick(100, 400), ..RveParameters::default() };
    let equal = RveParameters {
        grains: Grains { radius_min: RADIUS, radius_max: RADIUS, ..random.grains },
        ..random.clone()
    };
    let packed = consolidated(&random, 1)?;
    let crystal = relaxed(consolidated(&equal, 1)?, &equal)?;
    let bare = |p: &RveParameters| RveParameters {
        grains: Grains { friction: 1e6, damping_ratio: 0.0, ..p.grains },
        ..p.clone()
    };
    Ok(vec![
        (
            "chain of two discs, no friction",
            smooth.clone(),
            chain(&smooth),
            Some((1.0, "2/ω, ω² = 4 kn/m")),
        ),
        (
            "chain of two discs, sticking",
            sticking.clone(),
            chain(&sticking),
            Some((0.5_f64.sqrt(), "2/ω, ω² = 8 kt/m")),
        ),
        (
            "hexagonal lattice, sticking",
            sticking.clone(),
            hexagonal(&sticking),
            Some((1.0 / 6.0_f64.sqrt(), "2/ω, ω² = 24 kt/m")),
        ),
        (
            "packing, sticking, no dashpot",
            bare(&random),
            packed.clone(),
            Some((0.55, "2/ω, ω² = 2 Z kt/m, Z = 6: 0.577; 0.55 by an earlier code")),
        ),
        (
            "packing of equal discs, sticking, no dashpot",
            bare(&equal),
            crystal,
            Some((1.0 / 6.0_f64.sqrt(), "2/ω of a hexagonal lattice")),
        ),
        (
            "packing, friction 0.5, no dashpot",
            RveParameters {
                grains: Grains { damping_ratio: 0.0, ..random.grains },
                ..random.clone()
            },
            packed.clone(),
            None,
        ),
        ("packing, friction 0.5, dashpot 0.2 (default)", random, packed, None),
    ])
}

/// Finds the longest stable step of lattices and packings.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let tolerance = suite.pick(0.03, 0.005);
    let steps = suite.pick(3000, 20_000);
    let found: Vec<(Finding, Option<Picture>)> = cases(suite)?
        .into_par_iter()
        .map(|(name, p, packing, theory)| {
            let measured = critical(&packing, &p, tolerance);
            let factor = 1.05 * measured.value().unwrap_or(3.0);
            let mut rest = Rest::new(packing, &p, factor)?;
            let beyond = rest.outcome(steps);
            let drawn = name.contains("default").then(|| {
                picture(&rest.element.rve.packing, format!("{name} at {factor:.2}, at the end"))
            });
            Ok((
                Finding {
                    case: name.into(),
                    parameter: "step, √(m_min/kn)".into(),
                    measured,
                    theory: theory.map(|(value, formula)| (value, formula.into())),
                    beyond,
                },
                drawn,
            ))
        })
        .collect::<Result<_, StudyError>>()?;
    let mut study = Study {
        method: format!(
            "Packings at rest in a fixed cell for {steps} steps (that of equal discs after 10 000 steps \
             with a dashpot); unstable when the kinetic energy exceeds {HEAT} of the elastic energy. Steps in units of √(m_min/kn); scenes may ask for 0.005 to 0.5."
        ),
        ..Study::default()
    };
    for (finding, picture) in found {
        study.findings.push(finding);
        study.pictures.extend(picture);
    }
    study.maps.push(dashpot_map(suite)?);
    Ok(study)
}

/// Step and dashpot. A dashpot whose velocity lags half a step lowers the limit of a mode of
/// frequency `w` to `dt = (2 / w)(sqrt(1 + xi²) - xi)`.
fn dashpot_map(suite: Suite) -> Result<Map, StudyError> {
    let p = RveParameters { discs: 100, ..RveParameters::default() };
    let packing = consolidated(&p, 1)?;
    let damping = vec![0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0];
    let factors: Vec<f64> =
        (0..suite.pick(10, 19)).map(|k| 0.1 + suite.pick(0.1, 0.05) * f64::from(k)).collect();
    let outcome = |zeta: f64, factor: f64| -> Result<Outcome, StudyError> {
        let p = RveParameters { grains: Grains { damping_ratio: zeta, ..p.grains }, ..p.clone() };
        Ok(Rest::new(packing.clone(), &p, factor)?.outcome(suite.pick(1000, 5000)))
    };
    let row = |&factor: &f64| damping.iter().map(|&zeta| outcome(zeta, factor)).collect();
    // The stiffest translation: a light disc in contact with six neighbours at rest, half of whose
    // contacts act along one direction.
    let omega = 3.0_f64.sqrt();
    let share = (0.5 * 3.0_f64).sqrt();
    let limit = |zeta: f64| {
        let xi = zeta * share;
        2.0 / omega * ((1.0 + xi * xi).sqrt() - xi)
    };
    Ok(Map {
        title: "Packing at rest, friction 0.5".into(),
        outcomes: factors.par_iter().map(row).collect::<Result<_, StudyError>>()?,
        numbers: Vec::new(),
        caption: format!(
            "Theory, for a light disc with six neighbours at rest: (2/ω)(√(1+ξ²) − ξ), which is {}.",
            damping.iter().map(|&z| number(limit(z))).collect::<Vec<_>>().join(", ")
        ),
        x: Axis::new("dashpot, part of critical", damping),
        y: Axis::new("step, √(m_min/kn)", factors),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(p: &RveParameters, packing: &Packing<f64>) -> f64 {
        critical(packing, p, 0.01).value().unwrap()
    }

    /// The critical step of a linear oscillator, 2 / omega, of lattices with known spectra.
    #[test]
    fn lattices_become_unstable_where_their_spectra_say() {
        let smooth =
            RveParameters { grains: Grains { friction: 0.0, ..linear().grains }, ..linear() };
        let sticking =
            RveParameters { grains: Grains { friction: 1e6, ..linear().grains }, ..linear() };
        let free = measured(&smooth, &chain(&smooth));
        let rolling = measured(&sticking, &chain(&sticking));
        let hexagonal = measured(&sticking, &hexagonal(&sticking));
        assert!((free / 1.0 - 1.0).abs() < 0.02, "{free}");
        assert!((rolling / 0.5_f64.sqrt() - 1.0).abs() < 0.02, "{rolling}");
        assert!((hexagonal * 6.0_f64.sqrt() - 1.0).abs() < 0.03, "{hexagonal}");
    }
}
