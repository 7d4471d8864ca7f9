//! Runout and final height of mu(I) columns of several aspect ratios, as a Markdown table.
//!
//! A column of width 1 m and height a stands against a smooth wall on a floor of friction 0.5 and
//! is let go. `cargo run --release -p mpm --example collapse_scaling`

use mpm::{
    Domain, DruckerPrager, DruckerPragerParameters, Friction, Numerics, Points, Solver, Vec2, Walls,
};

const GRAVITY: f64 = 9.81;
const CELL: f64 = 0.0625;
const DT: f64 = 2.0e-4;

struct Deposit {
    aspect: f64,
    points: usize,
    time: f64,
    /// Right of 99 % of the mass, and of all of it (m).
    front: [f64; 2],
    height: f64,
    kinetic: f64,
    projected: u64,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "mu(I) law with its defaults, smooth left wall, floor friction 0.5, L0 = 1 m, cell {CELL} m, \
         2 x 2 points a cell, dt = {DT} s, quadratic splines, MUSL, FLIP relaxed towards APIC at 500 1/s\n"
    );
    println!(
        "| a = H/L0 | points | t_end (s) | runout, 99 % of mass | runout, all | final H/L0 | KE/E0 at end | projected |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut deposits = Vec::new();
    for aspect in [0.5, 1.0, 2.0, 3.0, 5.0] {
        let d = collapse(aspect)?;
        println!(
            "| {} | {} | {:.2} | {:.3} | {:.3} | {:.3} | {:.1e} | {} |",
            d.aspect,
            d.points,
            d.time,
            d.front[0] - 1.0,
            d.front[1] - 1.0,
            d.height,
            d.kinetic,
            d.projected
        );
        deposits.push(d);
    }
    println!();
    for (name, range) in [("a <= 2", 0..3), ("a >= 2", 2..5), ("all", 0..5)] {
        let fit = |value: fn(&Deposit) -> f64| exponent(&deposits[range.clone()], value);
        println!(
            "{name}: runout ~ a^{:.2} (99 %), a^{:.2} (all); height ~ a^{:.2}",
            fit(|d| d.front[0] - 1.0),
            fit(|d| d.front[1] - 1.0),
            fit(|d| d.height)
        );
    }
    Ok(())
}

fn collapse(aspect: f64) -> Result<Deposit, Box<dyn std::error::Error>> {
    let law = DruckerPragerParameters::default();
    let walls = Walls { bottom: Friction::Coulomb(0.5), ..Walls::default() };
    let width = (2.0 + 4.0 * aspect).ceil();
    let domain = Domain { size: Vec2::new(width, aspect + 1.0), walls, cell: CELL };
    let mut points =
        Points::rectangle(Vec2::zeros(), Vec2::new(1.0, aspect), CELL / 2.0, law.density);
    let mut material = DruckerPrager::new(law, &points.stress)?;
    let mut solver = Solver::new(domain, Numerics::default(), Vec2::new(0.0, -GRAVITY), vec![])?;
    let energy = solver.budget(&points).potential_energy;
    let time = 8.0 * (aspect / GRAVITY).sqrt();
    for _ in 0..(time / DT).round() as usize {
        solver.advance(&mut points, &mut material, DT)?;
    }
    let mut x: Vec<f64> = points.position.iter().map(|x| x.x).collect();
    x.sort_by(f64::total_cmp);
    let at_wall = points.position.iter().filter(|x| x.x < CELL).map(|x| x.y).fold(0.0, f64::max);
    Ok(Deposit {
        aspect,
        points: points.len(),
        time: solver.time(),
        front: [x[x.len() * 99 / 100], x[x.len() - 1]],
        height: at_wall + 0.25 * CELL,
        kinetic: solver.budget(&points).kinetic_energy / energy,
        projected: solver.ledger().projected,
    })
}

/// Slope of the least-squares line through (ln a, ln value).
fn exponent(deposits: &[Deposit], value: fn(&Deposit) -> f64) -> f64 {
    let n = deposits.len() as f64;
    let logs = || deposits.iter().map(|d| (d.aspect.ln(), value(d).ln()));
    let (mx, my) = logs().fold((0.0, 0.0), |s, (x, y)| (s.0 + x / n, s.1 + y / n));
    let (xy, xx) =
        logs().fold((0.0, 0.0), |s, (x, y)| (s.0 + (x - mx) * (y - my), s.1 + (x - mx).powi(2)));
    xy / xx
}
