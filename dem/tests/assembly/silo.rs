//! Pressure in a silo whose base yields.

use dem::Grains;
use dem::assembly::{Boundary, ColumnBox, Floor, Partner, RigidBox, profile};

use crate::common::{G, advance, assembly, faces, flat, gas};

const WIDTH: f64 = 0.08;
const FRICTION: f64 = 0.4;

/// Janssen (1895): with the part mu' of the friction that walls mobilise (discs also roll along them) and
/// K = horizontal over vertical stress, both as measured, the pressure on walls at depth z is
/// rho g D / (2 mu') (1 - exp(-z / l)) with l = D / (2 mu' K). Mean over the lower half, within 15 %.
#[test]
fn wall_pressure_saturates() {
    let p = Grains::default();
    let start = gas(&p, [0.0, 0.021], [7, 70], 0.0113, 0.1, 4);
    let mut base = RigidBox::fixed([-1.0, -1.0], [1.0, 0.02], faces(0.5));
    (base.velocity, base.start) = ([0.0, -0.01], 0.8);
    let boundary = Boundary {
        walls: faces(FRICTION),
        floor: Floor::Flat,
        boxes: vec![base],
        ..flat([WIDTH, 1.0], FRICTION)
    };
    let mut silo = assembly::<f32>(&p, &boundary, [0.0, -G], start);
    silo.set_drag(5.0);
    advance(&mut silo, 0.8);
    silo.set_drag(0.0);
    // The base sinks by half a mean diameter, averages over the last part.
    let (mut pressure, mut shear, samples) = (0.0, 0.0, 40);
    advance(&mut silo, 0.2);
    let states = silo.states();
    let top = states.iter().map(|s| s.x[1]).fold(0.0, f64::max);
    let weight: f64 = states.iter().map(|s| s.mass * G).sum();
    let middle = 0.02 + 0.5 * (top - 0.02);
    for _ in 0..samples {
        advance(&mut silo, 5.0e-3);
        let states = silo.states();
        let below = |k: u32| states[k as usize].x[1] < middle;
        for contact in silo.packed().contacts {
            let (Partner::Body(wall @ 0..=1), true) = (contact.partner, below(contact.grain))
            else {
                continue;
            };
            let state = states[contact.grain as usize];
            let distance = if wall == 0 { state.x[0] } else { WIDTH - state.x[0] };
            let normal = p.normal_stiffness * (state.r - distance) + contact.viscous;
            pressure += normal;
            // On the left wall friction up is clockwise around the grain.
            shear += contact.tangential * if wall == 0 { 1.0 } else { -1.0 };
        }
    }
    let height = top - 0.02;
    let area = height * p.thickness * f64::from(samples);
    let density = weight / (G * WIDTH * height * p.thickness);
    let lower = ColumnBox { corner: [0.0, 0.02], size: [WIDTH, 0.5 * height], loaded: true };
    let k0 = profile(&silo.states(), &lower, p.thickness, 1)[0].k0();
    let mobilised = shear / pressure;
    let length = WIDTH / (2.0 * mobilised * k0);
    let far = |z: f64| (-z / length).exp();
    let decayed = (far(0.5 * height) - far(height)) * length / (0.5 * height);
    let janssen = density * G * WIDTH / (2.0 * mobilised) * (1.0 - decayed);
    let hydrostatic = k0 * density * G * 0.75 * height;
    println!(
        "height {height:.3} m, K {k0:.2}, friction {mobilised:.2}, wall pressure {:.0} Pa, Janssen {janssen:.0} Pa, without walls {hydrostatic:.0} Pa",
        pressure / area,
    );
    assert!((pressure / area / janssen - 1.0).abs() < 0.15);
    assert!(janssen < 0.8 * hydrostatic);
    assert!(mobilised > 0.3 * FRICTION && mobilised <= FRICTION);
}
