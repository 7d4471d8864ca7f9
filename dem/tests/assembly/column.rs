//! Prepared columns.

use dem::Grains;
use dem::assembly::{
    Assembly, Boundary, ColumnBox, Floor, Layer, Packed, Partner, RigidBox, profile,
};
use rstest::rstest;

use crate::common::{
    G, GRAVITY, advance, column, column_domain, column_place, expect, faces, flat, prepare,
};

fn layers(packed: &Packed, place: &ColumnBox, domain: &Boundary, count: usize) -> Vec<Layer> {
    let p = Grains::default();
    let scene = Assembly::<f64>::new(&p, domain, GRAVITY, p.step(), packed).unwrap();
    profile(&scene.states(), place, p.thickness, count)
}

/// With frictionless grains a column of 0.2 m is as dense as walls allow, its vertical stress is its weight
/// (10 %: layers are five grains high), and its K0 nearly that of a liquid. Of ten such columns, single layers had
/// a K0 of 0.97 with a standard deviation of 0.12 and means of three layers one of 0.067: a layer is within
/// three of them, the mean within 0.15.
#[test]
fn profile_of_a_column() {
    let p = Grains::default();
    let place = column_place();
    let found = layers(column(), &place, &column_domain(), 4);
    let mean = found[..3].iter().map(Layer::k0).sum::<f64>() / 3.0;
    expect("mean K0", mean, 0.97, 0.15);
    for (k, layer) in found.iter().enumerate().take(3) {
        println!("{layer:?} K0 {:.3}", layer.k0());
        let above: f64 = found[k + 1..].iter().map(|l| l.solid_fraction).sum();
        let load = (above + 0.5 * layer.solid_fraction) * p.grain_density * G * 0.05;
        expect("vertical stress over weight", layer.vertical_stress / load, 1.0, 0.1);
        expect("K0 of a layer", layer.k0(), 0.97, 0.35);
        expect("solid fraction", layer.solid_fraction, 0.84, 0.02);
        expect("coordination", layer.coordination, 3.9, 0.35);
    }
}

/// No grain lies outside of the column's box by more than an overlap, and its top is filled.
#[test]
fn column_fills_its_box() {
    let grains = &column().grains;
    let highest = grains.iter().map(|g| g.x[1]).fold(0.0, f64::max);
    assert!(highest < 0.2 && highest > 0.195, "{highest}");
    assert!(grains.iter().all(|g| g.x[0] > 0.98 * g.r && 0.2 - g.x[0] > 0.98 * g.r));
    assert!(grains.iter().all(|g| g.v == [0.0; 2] && g.w == 0.0));
    assert!(column().contacts.iter().all(|c| c.partner != Partner::Body(0)));
}

/// Between a wall and a plate that stay, nothing starts to move: speeds remain below 2 mm/s, which a fall
/// over a thousandth of a diameter gives.
#[test]
fn stays_at_rest_behind_a_gate() {
    let p = Grains::default();
    let gate = RigidBox::fixed([0.2, 0.0], [0.25, 0.4], faces(0.0));
    let domain = Boundary { boxes: vec![gate], ..column_domain() };
    let mut scene = Assembly::<f32>::new(&p, &domain, GRAVITY, p.step(), column()).unwrap();
    let before = layers(column(), &column_place(), &domain, 2);
    for _ in 0..10 {
        advance(&mut scene, 0.02);
        let fastest = scene.states().iter().map(|s| s.v[0].hypot(s.v[1])).fold(0.0, f64::max);
        assert!(fastest < 0.05, "{fastest} m/s");
        assert!(scene.agitation(G) < 1.0e-5, "{}", scene.agitation(G));
    }
    let after = profile(&scene.states(), &column_place(), p.thickness, 2);
    expect("K0", after[0].k0() / before[0].k0(), 1.0, 0.05);
}

/// An unloaded column, released without gravity, keeps its shape to a tenth of a grain over half a second.
#[test]
fn unloaded_column_does_not_expand() {
    let p = Grains::default();
    let place = ColumnBox { corner: [0.1, 0.1], size: [0.12, 0.12], loaded: false };
    let domain = flat([0.4, 0.4], 0.0);
    let packed = prepare(&p, &domain, &place, 2);
    assert!(packed.grains.iter().all(|g| g.x[1] > 0.1 && g.x[1] < 0.22));
    let mut scene = Assembly::<f32>::new(&p, &domain, [0.0; 2], p.step(), &packed).unwrap();
    advance(&mut scene, 0.5);
    let states = scene.states();
    let pairs = states.iter().zip(&packed.grains);
    let moved: Vec<f64> = pairs.map(|(s, g)| (s.x[0] - g.x[0]).hypot(s.x[1] - g.x[1])).collect();
    let mean = moved.iter().sum::<f64>() / moved.len() as f64;
    println!("mean displacement {:.2} diameters", mean / p.mean_diameter());
    assert!(mean < 0.5 * p.mean_diameter());
}

/// Positions are as well resolved far from the origin as near it: a column at 60 m comes to rest in f32. Its grains
/// touch the grains of the floor that they name; overlaps are some 1e-6 m.
#[test]
fn a_column_far_from_the_origin_settles() {
    let p = Grains::default();
    let place = ColumnBox { corner: [60.0, 0.0], size: [0.2, 0.2], loaded: true };
    let domain = Boundary { floor: Floor::Rough, ..flat([80.0, 0.4], 0.0) };
    let packed = prepare(&p, &domain, &place, 1);
    let floor = domain.floor_grains(&p);
    let mut touching = 0;
    for contact in &packed.contacts {
        let Partner::Floor(index) = contact.partner else { continue };
        let (grain, (x, r)) = (packed.grains[contact.grain as usize], floor[index as usize]);
        let gap = (grain.x[0] - x[0]).hypot(grain.x[1] - x[1]) - grain.r - r;
        assert!((-1e-4..1e-5).contains(&gap), "{gap:e} m");
        touching += 1;
    }
    assert!(touching > 10, "{touching} contacts with the floor");
}

/// Columns of two grains across or two high, and of grains four times larger.
#[rstest]
#[case::narrow([0.02, 0.1], 1.0)]
#[case::low([0.2, 0.02], 1.0)]
#[case::small([0.021, 0.021], 1.0)]
#[case::coarse([0.2, 0.2], 4.0)]
fn odd_columns(#[case] size: [f64; 2], #[case] scale: f64) {
    let p = Grains {
        radius_min: scale * 2.5e-3,
        radius_max: scale * 5.0e-3,
        thickness: scale * 7.5e-3,
        ..Grains::default()
    };
    let place = ColumnBox { corner: [0.1, 0.0], size, loaded: true };
    let domain = Boundary { floor: Floor::Rough, ..flat([0.5, 0.4], 0.0) };
    let packed = prepare(&p, &domain, &place, 3);
    let area: f64 = packed.grains.iter().map(|g| std::f64::consts::PI * g.r * g.r).sum();
    let fraction = area / (size[0] * size[1]);
    println!("{} grains, solid fraction {fraction:.3}", packed.grains.len());
    assert!((0.6..1.0).contains(&fraction));
}

/// The same seed makes the same bits, another one other grains.
#[test]
fn seeds() {
    let p = Grains::default();
    let place = ColumnBox { corner: [0.0, 0.0], size: [0.06, 0.06], loaded: true };
    let make = |seed| prepare(&p, &column_domain(), &place, seed);
    let one = make(1);
    assert_eq!(one, make(1));
    assert_ne!(one, make(2));
}
