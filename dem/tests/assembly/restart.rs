//! The same bits for any number of threads and after a restart.

use dem::assembly::{Assembly, Grain, Packed, RigidBox};
use dem::{Grains, Real};
use rstest::rstest;

use crate::common::{
    GRAVITY, advance, assembly, column, column_domain, faces, flat, gas, with_box,
};

/// A violent scene over several tiles, with a moving plate.
fn scene<R: Real>(rolling_friction: f64) -> Assembly<R> {
    let p = Grains { rolling_friction, ..Grains::default() };
    let mut plate = RigidBox::fixed([0.0, 0.0], [0.05, 0.5], faces(0.3));
    plate.velocity = [1.0, 0.0];
    let start = gas(&p, [0.1, 0.0], [40, 20], 0.0105, 3.0, 5);
    assembly(&p, &with_box(flat([0.9, 0.5], 0.4), plate), GRAVITY, start)
}

#[rstest]
#[case::single(0.0f32)]
#[case::double(0.0f64)]
fn same_bits_for_any_number_of_threads<R: Real>(
    #[case] _precision: R,
    #[values(0.0, 0.2)] rolling_friction: f64,
) {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut scene = scene::<R>(rolling_friction);
            scene.advance(1500).unwrap();
            scene
        })
    };
    let one = run(1);
    assert!(one.searches() > 2, "{} searches", one.searches());
    assert_eq!(one, run(2));
    assert_eq!(one, run(3));
}

/// A state written and read at any step goes on with the same bits.
#[rstest]
fn resumes_bitwise(
    #[values(0, 1, 37, 400, 811)] steps: usize,
    #[values(0.0, 0.2)] rolling_friction: f64,
) {
    let mut scene = scene::<f32>(rolling_friction);
    scene.advance(steps).unwrap();
    let bytes = postcard::to_stdvec(&scene).unwrap();
    let mut resumed: Assembly<f32> = postcard::from_bytes(&bytes).unwrap();
    assert_eq!(scene, resumed);
    scene.advance(500).unwrap();
    resumed.advance(500).unwrap();
    assert_eq!(scene, resumed);
    assert_eq!(scene.energy(), resumed.energy());
}

/// Plain grains and contacts make the same assembly again; the order of discs, and with it the last bits of
/// sums of forces, may differ.
#[rstest]
#[case::single(0.0f32)]
#[case::double(0.0f64)]
fn packed_round_trip<R: Real>(#[case] _precision: R, #[values(0.0, 0.2)] rolling_friction: f64) {
    let p = Grains { rolling_friction, ..Grains::default() };
    let new = |packed: &Packed| {
        Assembly::<R>::new(&p, &column_domain(), GRAVITY, p.step(), packed).unwrap()
    };
    let mut scene = new(column());
    advance(&mut scene, 0.05);
    let packed = scene.packed();
    assert_eq!(packed.contacts.iter().any(|c| c.rolling != 0.0), rolling_friction != 0.0);
    let again = new(&packed).packed();
    assert_eq!(packed.contacts, again.contacts);
    let near = |a: &Grain, b: &Grain| {
        a.v == b.v && a.w == b.w && a.r == b.r && (0..2).all(|k| (a.x[k] - b.x[k]).abs() < 1e-15)
    };
    assert!(packed.grains.iter().zip(&again.grains).all(|(a, b)| near(a, b)));
    let mut resumed = new(&packed);
    let (a, b) = (scene.energy(), resumed.energy());
    assert!((a.elastic - b.elastic).abs() < 1e-9 * a.elastic);
    scene.advance(10).unwrap();
    resumed.advance(10).unwrap();
    for (a, b) in scene.states().iter().zip(resumed.states()) {
        assert!((a.v[0] - b.v[0]).abs() < 1e-5 && (a.v[1] - b.v[1]).abs() < 1e-5);
    }
}
