//! What cannot be advanced is an error that names the grain and the step.

use dem::Grains;
use dem::assembly::{
    Assembly, AssemblyError, Boundary, ColumnBox, Floor, Grain, GrainFailure, RigidBox, on_cpu,
    prepare_column,
};
use rstest::rstest;

use crate::common::{GRAVITY, assembly, faces, flat, grain, loose, with_box};

const R: f64 = 4.0e-3;

/// Two good grains and a bad one.
fn start(bad: Grain) -> Vec<Grain> {
    vec![grain([0.05, 0.05], [0.0; 2], R), grain([0.1, 0.05], [0.0; 2], R), bad]
}

fn domain() -> Boundary {
    let obstacle = RigidBox::fixed([0.14, 0.0], [0.16, 0.1], faces(0.5));
    with_box(flat([0.2, 0.2], 0.5), obstacle)
}

#[track_caller]
fn expect_failure(error: AssemblyError, at: usize, why: GrainFailure, later: bool) {
    let text = error.to_string();
    let AssemblyError::Grain { grain, step, failure, .. } = error else { panic!("{text}") };
    assert_eq!(grain, at, "{text}");
    assert_eq!(std::mem::discriminant(&failure), std::mem::discriminant(&why), "{text}");
    assert_eq!(step > 0, later, "{text}");
    assert!(text.contains(&format!("DEM step {step}: grain {at} ")), "{text}");
}

#[rstest]
#[case::outside(grain([0.5, 0.05], [0.0; 2], R), GrainFailure::Outside)]
#[case::in_wall(grain([-0.001, 0.05], [0.0; 2], R), GrainFailure::Leak)]
#[case::in_box(grain([0.15, 0.05], [0.0; 2], R), GrainFailure::Leak)]
#[case::position(grain([f64::NAN, 0.05], [0.0; 2], R), GrainFailure::NotFinite)]
#[case::velocity(grain([0.02, 0.05], [0.0, f64::INFINITY], R), GrainFailure::NotFinite)]
#[case::spin(Grain { w: f64::NAN, ..grain([0.02, 0.05], [0.0; 2], R) }, GrainFailure::NotFinite)]
#[case::radius(grain([0.02, 0.05], [0.0; 2], f64::NAN), GrainFailure::NotFinite)]
fn bad_start(#[case] bad: Grain, #[case] why: GrainFailure) {
    let p = Grains::default();
    let made = Assembly::<f32>::new(&p, &domain(), GRAVITY, p.step(), &loose(start(bad)));
    expect_failure(made.unwrap_err(), 2, why, false);
}

/// At 30 m/s grain 2 strikes grain 1 too hard for its stiffness.
#[test]
fn overlap_beyond_the_limit() {
    let p = Grains { overlap_limit: 0.3, ..Grains::default() };
    let bad = grain([0.12, 0.05], [-30.0, 0.0], R);
    let mut scene = assembly::<f64>(&p, &domain(), [0.0; 2], start(bad));
    let error = scene.advance(2000).unwrap_err();
    let AssemblyError::Grain { grain: at, step, failure, position } = error else { panic!() };
    assert!(at == 1 || at == 2);
    assert!(matches!(failure, GrainFailure::Overlap(x) if x > 0.3 && x < 0.5), "{failure}");
    // 12 mm at 30 m/s, and a part of a collision.
    let contact = (0.02 - 2.0 * R) / 30.0 / p.step();
    assert!(step as f64 > contact && (step as f64) < contact + 10.0, "{step}");
    assert!((position[0] - 0.105).abs() < 0.01);
}

/// Far too fast: through the wall of the box within a step.
#[test]
fn leak() {
    let p = Grains::default();
    let bad = grain([0.12, 0.08], [600.0, 0.0], R);
    let mut scene = assembly::<f64>(&p, &domain(), [0.0; 2], start(bad));
    expect_failure(scene.advance(2000).unwrap_err(), 2, GrainFailure::Leak, true);
}

/// A step far beyond the limit of stability ends with an error, not with nonsense.
#[test]
fn unstable_step() {
    let p = Grains::default();
    let near = vec![grain([0.05, 0.05], [0.1, 0.0], R), grain([0.0579, 0.05], [0.0; 2], R)];
    let domain = flat([0.2, 0.2], 0.5);
    let mut scene =
        Assembly::<f32>::new(&p, &domain, GRAVITY, 50.0 * p.step(), &loose(near)).unwrap();
    assert!(scene.advance(100_000).is_err());
}

#[rstest]
#[case::narrow([0.008, 0.5])]
#[case::low([0.5, 0.008])]
fn grain_larger_than_the_column(#[case] size: [f64; 2]) {
    let place = ColumnBox { corner: [0.0, 0.0], size, loaded: true };
    let domain = Boundary { floor: Floor::Rough, ..flat([1.0, 1.0], 0.5) };
    let error = prepare_column::<f32>(&Grains::default(), &domain, GRAVITY, &place, 1, &mut on_cpu)
        .unwrap_err();
    assert!(error.to_string().contains("larger than"), "{error}");
}
