//! Distance between two runs that differ only in the seed, or only in the step, for each velocity
//! transfer.

use dempm::scene::Scene;
use mpm::Transfer;

use crate::run::{PARTS, Run};

pub fn study(scene: &Scene) -> miette::Result<()> {
    let transfers = [
        ("flip-apic, 500 1/s", Transfer::FlipApic { rate: 500.0 }),
        ("flip-apic, 100 1/s", Transfer::FlipApic { rate: 100.0 }),
        ("apic", Transfer::Apic),
        ("flip, 1 1/s", Transfer::Flip { rate: 1.0 }),
    ];
    let times = PARTS.map(|p| format!("{:.2} s", p * scene.duration)).join(" | ");
    println!("| transfer | compared | {times} | fronts | pressure scatter |");
    println!("|---|---|{}---|---|", "---|".repeat(PARTS.len()));
    for (name, transfer) in transfers {
        let variant = |seed, step| {
            let mut scene = scene.clone();
            scene.numerics.transfer = transfer;
            scene.seed = seed;
            scene.step = step;
            Run::new(scene)
        };
        let base = variant(scene.seed, scene.step)?;
        let rows = [
            ("two seeds", variant(scene.seed + 1, scene.step)?),
            ("dt, dt/2", variant(scene.seed, 0.5 * scene.step)?),
        ];
        for (compared, other) in rows {
            let distance = base.distance(&other, scene.domain.size[0]).join(" | ");
            let fronts = format!("{:.2}, {:.2} m", base.front(), other.front());
            println!("| {name} | {compared} | {distance} | {fronts} | {:.2} |", other.scatter);
        }
    }
    Ok(())
}
