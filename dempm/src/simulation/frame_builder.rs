//! Header and frames of a trajectory from a simulation.

use std::collections::BTreeMap;

use mpm::Mat2;

use super::driver::Simulation;
use super::state::{SceneMaterial, State};
use crate::scene::{self, Precision};
use crate::trajectory::{self, Field, Frame, Header};

/// Name of the budget scalar with the largest provably stable macro step (s).
pub const STABLE_STEP: &str = "stable_step";

impl Simulation {
    /// The header of the trajectory of a run that began at `created` (UTC, ISO 8601).
    pub fn header(&self, created: String) -> Header {
        let scene = &self.scene;
        let [width, height] = scene.domain.size;
        let text = str::to_owned;
        let mut parameters = BTreeMap::new();
        let mut precision = "f64";
        if let scene::Material::Rve(rve) = &scene.material {
            let p = &rve.parameters;
            if rve.precision == Precision::F32 {
                precision = "f32 (DEM), f64 (MPM)";
            }
            // Stress scales with 1/thickness, cost with discs and substeps.
            parameters.insert(text("rve_discs"), p.discs as f64);
            parameters.insert(text("rve_thickness"), p.grains.thickness);
            parameters.insert(text("rve_step"), scene.step / p.grains.substeps(scene.step) as f64);
            parameters.insert(text("rve_substeps"), p.grains.substeps(scene.step) as f64);
        }
        Header {
            title: scene.title.clone(),
            scene: scene.text.clone(),
            seed: scene.seed,
            created,
            versions: BTreeMap::from([(text("dempm"), text(env!("CARGO_PKG_VERSION")))]),
            device: self.device.clone(),
            precision: text(precision),
            material: text(scene.material.name()),
            domain: scene.domain.size,
            gravity: scene.gravity,
            grid_cell: scene.domain.cell,
            point_spacing: scene.domain.spacing(),
            time_step: scene.step,
            frame_interval: scene.frame_interval,
            parameters,
            walls: vec![
                [0.0, 0.0, 0.0, height],
                [width, 0.0, width, height],
                [0.0, 0.0, width, 0.0],
                [0.0, height, width, height],
            ],
        }
    }

    /// Properties of the points that never change.
    pub fn static_points(&self) -> trajectory::Points {
        let column = self.scene.points().column;
        trajectory::Points { mass: self.state.points.mass.clone(), column }
    }

    /// The present state with the fields that the scene asks for.
    pub fn frame(&self) -> Frame {
        let State { points, material, .. } = &self.state;
        let wanted = |field| self.scene.fields.contains(&field);
        let rve = match material {
            SceneMaterial::Rve(rve) => Some(rve),
            SceneMaterial::MuI(_) | SceneMaterial::Elastic(_) => None,
        };
        let of_rve = |field, value: &dyn Fn(&dem::RveState) -> f64| {
            let rve = rve.filter(|_| wanted(field))?;
            Some(rve.states().iter().map(|state| value(state) as f32).collect())
        };
        Frame {
            time: self.time(),
            position: points.position.iter().map(|&x| x.into()).collect(),
            velocity: points.velocity.iter().map(|&v| v.into()).collect(),
            stress: wanted(Field::Stress).then(|| {
                let rows = |s: &Mat2| [(0, 0), (0, 1), (1, 0), (1, 1)].map(|k| s[k] as f32);
                points.stress.iter().map(rows).collect()
            }),
            solid_fraction: of_rve(Field::SolidFraction, &|state| state.solid_fraction),
            coordination: of_rve(Field::Coordination, &|state| state.coordination),
            inertial_number: wanted(Field::InertialNumber).then(|| {
                let (diameter, density) = self.scene.material.grain();
                let of_point = |(l, stress): (&Mat2, &Mat2)| {
                    let pressure = -0.5 * stress.trace();
                    dem::inertial_number(l, pressure, diameter, density) as f32
                };
                points.velocity_gradient.iter().zip(&points.stress).map(of_point).collect()
            }),
            boxes: self.boxes(),
            budget: self.budget(),
        }
    }

    /// Obstacles and plate at the present time.
    fn boxes(&self) -> Vec<[f64; 4]> {
        let corners = |o: mpm::Obstacle| [o.min.x, o.min.y, o.max.x, o.max.y];
        self.solver.obstacles_at(self.time()).map(corners).collect()
    }

    /// Scalars of the whole scene: energies, momentum, front, height and stable step.
    fn budget(&self) -> BTreeMap<String, f64> {
        let State { points, material, .. } = &self.state;
        let budget = self.solver.budget(points);
        let largest = |k: usize| points.position.iter().map(|x| x[k]).fold(f64::MIN, f64::max);
        let mut scalars = BTreeMap::from([
            ("front".to_owned(), largest(0)),
            ("max_height".to_owned(), largest(1)),
            ("kinetic_energy".to_owned(), budget.kinetic_energy),
            ("potential_energy".to_owned(), budget.potential_energy),
            ("momentum_x".to_owned(), budget.momentum.x),
            ("momentum_y".to_owned(), budget.momentum.y),
            ("plate_work".to_owned(), budget.contact.plate_work),
            ("points_projected".to_owned(), budget.contact.projected as f64),
        ]);
        // There is no stable step for points that the solver would refuse.
        let stable = self.solver.stable_step(points, material.as_dyn());
        let (bound, courant) =
            stable.map_or((f64::NAN, f64::NAN), |s| (s.gershgorin, s.courant(self.scene.step)));
        scalars.insert(STABLE_STEP.to_owned(), bound);
        scalars.insert("courant".to_owned(), courant);
        if let SceneMaterial::Rve(rve) = material {
            let loaded = rve.states().iter().filter(|state| !state.free).count();
            scalars.insert("stress_free_points".to_owned(), (rve.states().len() - loaded) as f64);
        }
        scalars
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    /// A frame shows the plate where it is, once moved.
    #[test]
    fn a_plate_is_recorded_where_it_is() {
        let text = r#"
            duration = 0.01
            frame_interval = 0.005
            [domain]
            size = [1.0, 0.75]
            [[column]]
            size = [0.25, 0.25]
            [plate]
            corner = [0.0, 0.375]
            size = [0.25, 0.25]
            velocity = [0.0, -0.5]
            start = 0.001
            [material]
            kind = "mu-i"
        "#;
        let mut simulation = Simulation::new(Scene::parse(text, "test.toml").unwrap()).unwrap();
        assert_eq!(simulation.frame().boxes, [[0.0, 0.375, 0.25, 0.625]]);
        for _ in 0..50 {
            simulation.advance().unwrap();
        }
        let [[_, bottom, _, top]] = simulation.frame().boxes[..] else { panic!("one box") };
        assert!((bottom - 0.373).abs() < 1.0e-12 && (top - 0.623).abs() < 1.0e-12, "{bottom}");
    }
}
