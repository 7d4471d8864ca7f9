//! Every wrong input is an error that says what and where.

mod common;

use common::*;
use mpm::{
    Domain, DruckerPrager, DruckerPragerParameters, Elastic, ElasticParameters, Error, Friction,
    Mat2, Material, MaterialError, Numerics, Obstacle, Points, Solver, Transfer, Vec2, Walls,
};
use rstest::rstest;

fn domain() -> Domain {
    Domain { size: Vec2::new(1.0, 1.0), walls: Walls::default(), cell: 0.1 }
}

fn make(domain: Domain, numerics: Numerics, obstacles: Vec<Obstacle>) -> Result<Solver, Error> {
    Solver::new(domain, numerics, Vec2::zeros(), obstacles)
}

fn step(change: impl Fn(&mut Points)) -> String {
    let mut solver = make(domain(), Numerics::default(), vec![]).unwrap();
    let mut points = Points::rectangle(Vec2::new(0.2, 0.2), Vec2::new(0.4, 0.4), 0.05, 1.0);
    change(&mut points);
    let stable = solver.stable_step(&points, &Dust);
    let error = solver.advance(&mut points, &mut Dust, 1.0e-3).unwrap_err().to_string();
    assert_eq!(stable.unwrap_err().to_string(), error);
    error
}

#[test]
fn points_that_cannot_be_advanced() {
    let message = step(|p| p.position[3] = Vec2::new(1.5, 0.2));
    assert_eq!(
        message,
        "point 3: position (1.5, 0.2) is outside of the domain, whose size is (1, 1)"
    );
    assert!(step(|p| p.position[5].y = f64::NAN).starts_with("point 5: position (0.275, NaN)"));
    assert!(step(|p| p.velocity[2].x = f64::INFINITY).starts_with("point 2: position"));
    assert_eq!(step(|p| p.mass[1] = 0.0), "point 1: mass 0 kg/m is not a positive number");
    assert!(
        step(|p| {
            p.stress.pop();
        })
        .contains("`stress` has 15 entries, `position` has 16")
    );
}

#[rstest]
#[case(0.0)]
#[case(-1.0)]
#[case(f64::NAN)]
#[case(f64::INFINITY)]
fn steps_that_are_no_steps(#[case] dt: f64) {
    let mut solver = make(domain(), Numerics::default(), vec![]).unwrap();
    assert!(matches!(solver.advance(&mut Points::default(), &mut Dust, dt), Err(Error::Step(_))));
}

#[test]
fn no_points_are_fine() {
    let mut solver = make(domain(), Numerics::default(), vec![]).unwrap();
    solver.advance(&mut Points::default(), &mut Dust, 0.1).unwrap();
    assert_eq!(solver.stable_step(&Points::default(), &Dust).unwrap().gershgorin, f64::INFINITY);
}

/// A point that flies more than a cell through a wall, or starts deep in an obstacle.
#[test]
fn points_far_beyond_a_face() {
    let mut solver = make(domain(), Numerics::default(), vec![]).unwrap();
    let mut points = Points::default();
    points.push(Vec2::new(0.5, 0.5), 1.0, 0.01);
    points.velocity[0] = Vec2::new(100.0, 0.0);
    let error = solver.advance(&mut points, &mut Dust, 0.1).unwrap_err();
    assert!(matches!(error, Error::OutsideDomain { point: 0, .. }), "{error}");

    let (min, max) = (Vec2::new(0.2, 0.2), Vec2::new(0.8, 0.8));
    let block = Obstacle { min, max, faces: Walls::default(), velocity: Vec2::zeros(), start: 0.0 };
    let mut solver = make(domain(), Numerics::default(), vec![block]).unwrap();
    let mut points = Points::default();
    points.push(Vec2::new(0.5, 0.5), 1.0, 0.01);
    let error = solver.advance(&mut points, &mut Dust, 0.1).unwrap_err().to_string();
    assert_eq!(error, "point 0: position (0.5, 0.5) is more than a cell deep in obstacle 0");
}

#[test]
fn a_material_that_returns_nonsense() {
    struct Broken;
    impl Material for Broken {
        fn update(
            &mut self,
            _: f64,
            _: &[Mat2],
            s: &mut [Mat2],
            _: &mut [f64],
        ) -> Result<(), MaterialError> {
            s[7][(0, 1)] = f64::NAN;
            Ok(())
        }
        fn wave_modulus(&self, _: usize) -> f64 {
            1.0
        }
    }
    let mut solver = make(domain(), Numerics::default(), vec![]).unwrap();
    let mut points = Points::rectangle(Vec2::new(0.2, 0.2), Vec2::new(0.4, 0.4), 0.05, 1.0);
    let error = solver.advance(&mut points, &mut Broken, 1.0e-3).unwrap_err();
    assert!(matches!(error, Error::Response { point: 7, .. }), "{error}");

    let mut other = DruckerPrager::new(DruckerPragerParameters::default(), &[]).unwrap();
    let error = solver.advance(&mut points, &mut other, 1.0e-3);
    let wrong_length = MaterialError::Length { expected: 0, found: 16 }.to_string();
    // The points still carry the NaN of the broken material.
    points.stress.fill(Mat2::zeros());
    assert!(error.is_err());
    points = Points::rectangle(Vec2::new(0.2, 0.2), Vec2::new(0.4, 0.4), 0.05, 1.0);
    assert_eq!(
        solver.advance(&mut points, &mut other, 1.0e-3).unwrap_err().to_string(),
        wrong_length
    );
}

#[test]
fn domains_numerics_and_obstacles_that_make_no_sense() {
    let fails = |d: Domain, n: Numerics, o: Vec<Obstacle>| {
        make(d, n, o).map(|_| ()).unwrap_err().to_string()
    };
    let (d, n) = (domain(), Numerics::default());
    assert!(fails(Domain { cell: 0.3, ..d }, n, vec![]).contains("whole number"));
    assert!(fails(Domain { cell: f64::NAN, ..d }, n, vec![]).contains("must be positive"));
    assert!(fails(Domain { cell: 1.0e-6, ..d }, n, vec![]).contains("cells are more than"));
    let walls = Walls { left: Friction::Coulomb(-0.1), ..Walls::default() };
    assert!(fails(Domain { walls, ..d }, n, vec![]).contains("friction coefficient -0.1"));
    let transfer = Transfer::Flip { rate: -1.0 };
    assert!(fails(d, Numerics { transfer, ..n }, vec![]).contains("transfer rate -1"));
    assert!(fails(d, Numerics { mass_cutoff: f64::NAN, ..n }, vec![]).contains("mass_cutoff"));
    let block = Obstacle {
        min: Vec2::new(0.5, 0.5),
        max: Vec2::new(0.4, 0.6),
        faces: walls,
        velocity: Vec2::zeros(),
        start: 0.0,
    };
    assert_eq!(fails(d, n, vec![block]), "obstacle 0: min must be less than max along both axes");
    assert!(Solver::new(d, n, Vec2::new(f64::NAN, 0.0), vec![]).is_err());
}

#[test]
fn material_parameters_that_make_no_sense() {
    let law = ElasticParameters { poisson_ratio: 0.5, ..ElasticParameters::default() };
    assert_eq!(
        Elastic::new(law).unwrap_err().to_string(),
        "material parameter `poisson_ratio` = 0.5 must be between -1 and 0.5"
    );
    let law = DruckerPragerParameters { grain_diameter: f64::NAN, ..Default::default() };
    assert!(
        DruckerPrager::new(law, &[]).unwrap_err().to_string().contains("`grain_diameter` = NaN")
    );
}

/// Names in a scene file; unknown keys are errors.
#[test]
fn parameters_are_read_by_name() {
    let numerics: Numerics = toml::from_str(
        "basis = 'gimp'\nscheme = 'usf'\ntransfer = { flip-apic = { rate = 100.0 } }",
    )
    .unwrap();
    assert_eq!(numerics.transfer, Transfer::FlipApic { rate: 100.0 });
    assert_eq!(toml::from_str::<Numerics>("transfer = 'apic'").unwrap().transfer, Transfer::Apic);
    assert!(
        toml::from_str::<Numerics>("bassis = 'gimp'").unwrap_err().to_string().contains("bassis")
    );
    let walls: Walls = toml::from_str("bottom = { coulomb = 0.5 }\nleft = 'stick'").unwrap();
    assert_eq!(
        walls,
        Walls { bottom: Friction::Coulomb(0.5), left: Friction::Stick, ..Walls::default() }
    );
    assert!(toml::from_str::<DruckerPragerParameters>("youngs = 1.0").is_err());
    assert!(toml::from_str::<ElasticParameters>("young_modulus = 1.0").is_ok());
}
