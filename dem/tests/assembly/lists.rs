//! Neighbour lists against brute force.

use dem::assembly::{Assembly, Boundary, Floor, RigidBox};
use dem::{Grains, Real};
use rstest::rstest;

use crate::common::{GRAVITY, assembly, faces, flat, gas};

/// Contacts of each grain, by all pairs.
fn brute_force<R: Real>(scene: &Assembly<R>, boundary: &Boundary, p: &Grains) -> Vec<u32> {
    let states = scene.states();
    let touches = |a: [f64; 2], b: [f64; 2], reach: f64| {
        // A margin of the resolution of positions in f32.
        (a[0] - b[0]).hypot(a[1] - b[1]) < reach - 1.0e-8
    };
    let floor = boundary.floor_grains(p);
    let [width, height] = boundary.size;
    states
        .iter()
        .enumerate()
        .map(|(i, a)| {
            let others = states.iter().enumerate().filter(|&(j, _)| i != j);
            let grains = others.filter(|(_, b)| touches(a.x, b.x, a.r + b.r)).count();
            let fixed = floor.iter().filter(|(x, r)| touches(a.x, *x, a.r + r)).count();
            let mut walls = vec![a.x[0], width - a.x[0], height - a.x[1]];
            if boundary.floor == Floor::Flat {
                walls.push(a.x[1]);
            }
            let walls = walls.iter().filter(|&&x| x < a.r - 1.0e-8).count();
            let boxes = boundary.boxes.iter().filter(|body| {
                let [x, y] = body.branch(a.x, scene.time());
                x.hypot(y) < a.r - 1.0e-8
            });
            (grains + fixed + walls + boxes.count()) as u32
        })
        .collect()
}

/// Grains of up to 5 m/s between walls, a box, a plate and the floor: at every step each has the contacts
/// that it has by brute force, but those of less than 1e-8 m.
#[rstest]
fn no_contact_is_missed(
    #[values((Floor::Rough, 1), (Floor::Flat, 2))] (floor, seed): (Floor, u64),
    #[values(0.02, 0.3, 1.0)] skin: f64,
) {
    let p = Grains { skin, damping_ratio: 0.02, ..Grains::default() };
    let mut plate = RigidBox::fixed([0.0, 0.0], [0.03, 0.5], faces(0.3));
    (plate.velocity, plate.start) = ([4.0, 0.0], 5.0e-3);
    let obstacle = RigidBox::fixed([0.3, 0.0], [0.33, 0.1], faces(0.3));
    let boundary = Boundary { floor, boxes: vec![plate, obstacle], ..flat([0.5, 0.5], 0.4) };
    let mut start = gas(&p, [0.05, 0.11], [20, 10], 0.0105, 5.0, seed);
    start.extend(gas(&p, [0.35, 0.0], [12, 8], 0.0105, 1.0, seed + 10));
    let mut scene = assembly::<f32>(&p, &boundary, GRAVITY, start);
    let mut contacts = 0;
    for step in 0..1500 {
        scene.advance(1).unwrap();
        let counted: Vec<u32> = scene.states().iter().map(|s| s.contacts).collect();
        let expected = brute_force(&scene, &boundary, &p);
        for (grain, (counted, expected)) in counted.iter().zip(&expected).enumerate() {
            assert!(counted >= expected, "step {step}: grain {grain} misses a contact");
        }
        let counted: u32 = counted.iter().sum();
        let expected: u32 = expected.iter().sum();
        assert!(
            counted - expected <= 4,
            "step {step}: {counted} contacts, {expected} by brute force"
        );
        contacts += expected;
    }
    assert!(contacts > 1000);
}
