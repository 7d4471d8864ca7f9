//! How much a collapse changes when the step is halved, and when points are displaced by a
//! micrometre at the start, for each velocity transfer, as a Markdown table. The second is the noise
//! below which a difference means nothing.
//!
//! The mu(I) law, a column of 3 m x 3 m in a box of 10 m (2304 points). Differences are means over
//! points of squared distances, over the squared box size.
//! `cargo run --release -p mpm --example transfer_convergence`

use mpm::{
    Domain, DruckerPrager, DruckerPragerParameters, Error, Friction, Numerics, Points, Solver,
    Transfer, Vec2, Walls,
};

const DT: f64 = 1.0e-4;
const BOX: f64 = 10.0;
/// Times of the columns (s).
const TIMES: [f64; 6] = [0.2, 0.5, 1.0, 1.5, 2.0, 3.0];

struct Run {
    points: Points,
    material: DruckerPrager,
    solver: Solver,
}

impl Run {
    fn new(transfer: Transfer) -> Result<Self, Box<dyn std::error::Error>> {
        let law = DruckerPragerParameters::default();
        let walls = Walls { bottom: Friction::Coulomb(0.5), ..Walls::default() };
        let domain = Domain { size: Vec2::new(BOX, BOX), walls, cell: 0.125 };
        let points = Points::rectangle(Vec2::zeros(), Vec2::new(3.0, 3.0), 0.0625, law.density);
        let material = DruckerPrager::new(law, &points.stress)?;
        let numerics = Numerics { transfer, ..Numerics::default() };
        let solver = Solver::new(domain, numerics, Vec2::new(0.0, -9.81), vec![])?;
        Ok(Self { points, material, solver })
    }

    fn advance(&mut self, dt: f64, steps: usize) -> Result<(), Error> {
        (0..steps).try_for_each(|_| self.solver.advance(&mut self.points, &mut self.material, dt))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("dt = {DT} s, quadratic splines, MUSL, floor friction 0.5, smooth walls\n");
    let times: Vec<String> = TIMES.iter().map(|t| format!("{t} s")).collect();
    println!(
        "| transfer | against | {} | centre of mass x (m) | front (m) | projected |",
        times.join(" | ")
    );
    println!("|---|---|{}---|---|---|", "---|".repeat(TIMES.len()));
    for (name, transfer) in [
        ("FLIP to APIC 500 1/s", Transfer::FlipApic { rate: 500.0 }),
        ("FLIP to APIC 100 1/s", Transfer::FlipApic { rate: 100.0 }),
        ("FLIP to APIC 2000 1/s", Transfer::FlipApic { rate: 2000.0 }),
        ("APIC", Transfer::Apic),
        ("FLIP 1 1/s", Transfer::Flip { rate: 1.0 }),
        ("FLIP 100 1/s", Transfer::Flip { rate: 100.0 }),
    ] {
        let (mut coarse, mut fine, mut moved) =
            (Run::new(transfer)?, Run::new(transfer)?, Run::new(transfer)?);
        for (p, x) in moved.points.position.iter_mut().enumerate() {
            *x += Vec2::new((p as f64).sin(), (1.7 * p as f64).sin()) * 1.0e-6;
        }
        let (mut step, mut noise) = (String::new(), String::new());
        let mut before = 0;
        for t in TIMES {
            let steps = (t / DT).round() as usize - before;
            before += steps;
            coarse.advance(DT, steps)?;
            fine.advance(0.5 * DT, 2 * steps)?;
            moved.advance(DT, steps)?;
            step += &format!(" {:.1e} |", difference(&coarse.points, &fine.points));
            noise += &format!(" {:.1e} |", difference(&coarse.points, &moved.points));
        }
        let x = &coarse.points.position;
        let mean = x.iter().map(|x| x.x).sum::<f64>() / x.len() as f64;
        let front = x.iter().map(|x| x.x).fold(0.0, f64::max);
        println!(
            "| {name} | dt/2 |{step} {mean:.3} | {front:.2} | {} |",
            coarse.solver.ledger().projected
        );
        println!("| | 1e-6 m |{noise} | | |");
    }
    Ok(())
}

fn difference(a: &Points, b: &Points) -> f64 {
    let sum: f64 = a.position.iter().zip(&b.position).map(|(a, b)| (a - b).norm_squared()).sum();
    sum / a.len() as f64 / (BOX * BOX)
}
