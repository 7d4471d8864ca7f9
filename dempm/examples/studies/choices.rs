//! The effect of each modelling choice on a column, one changed at a time.

use dem::RveParameters;
use dempm::scene::{InitialStress, Material, Precision, Rve, Scene};
use mpm::{Basis, Scheme, WallContact};

use crate::run::{PARTS, Run};

pub fn study(scene: &Scene) -> miette::Result<()> {
    let times = PARTS.map(|p| format!("{:.2} s", p * scene.duration)).join(" | ");
    println!("| changed | {times} | front | height | pressure scatter | held thin | stress-free |");
    println!("|---|{}---|---|---|---|---|", "---|".repeat(PARTS.len()));
    let base = Run::new(scene.clone())?;
    row("(nothing)", &base, &base, scene);
    for (name, change) in changes() {
        let mut changed = scene.clone();
        change(&mut changed);
        row(name, &base, &Run::new(changed)?, scene);
    }
    Ok(())
}

fn row(name: &str, base: &Run, run: &Run, scene: &Scene) {
    let distance = base.distance(run, scene.domain.size[0]).join(" | ");
    let (front, height, scatter) = (run.front(), run.height(), run.scatter);
    let Some(rve) = run.simulation.packings() else {
        return;
    };
    let share = |n: u64| 100.0 * n as f64 / rve.tally.steps as f64;
    let (thin, free) = (share(rve.tally.thin_steps), share(rve.tally.free_steps));
    println!(
        "| {name} | {distance} | {front:.2} m | {height:.2} m | {scatter:.2} | {thin:.2} % | {free:.2} % |"
    );
}

type Change = (&'static str, fn(&mut Scene));

fn changes() -> Vec<Change> {
    vec![
        ("another seed", |s| s.seed += 1),
        ("f64", |s| rve(s).precision = Precision::F64),
        ("8 packings", |s| rve(s).packings = 8),
        ("100 discs", |s| p(s).discs = 100),
        ("400 discs", |s| p(s).discs = 400),
        ("800 discs", |s| p(s).discs = 800),
        ("no initial stress", |s| s.initial_stress = InitialStress::None),
        ("loose: preparation.friction 0.5", |s| p(s).grains.preparation_friction = 0.5),
        ("damping_ratio 0.05", |s| p(s).grains.damping_ratio = 0.05),
        ("local_damping 0.2", |s| p(s).grains.local_damping = 0.2),
        ("mass_scale 100", |s| p(s).grains.mass_scale = 100.0),
        ("thickness 75 mm", |s| p(s).grains.thickness = 75.0e-3),
        ("friction 0.3", |s| p(s).grains.friction = 0.3),
        ("free_solid_fraction 0.6", |s| p(s).free_solid_fraction = 0.6),
        ("thin_width 0", |s| p(s).thin_width = 0.0),
        ("kinetic_stress false", |s| p(s).kinetic_stress = false),
        ("cell_average true", |s| s.numerics.cell_average_volumetric = true),
        ("wall_contact points", |s| s.numerics.wall_contact = WallContact::Points),
        ("basis gimp", |s| s.numerics.basis = Basis::Gimp),
        ("scheme usl", |s| s.numerics.scheme = Scheme::Usl),
        ("scheme usf", |s| s.numerics.scheme = Scheme::Usf),
    ]
}

/// The changes above are for scenes of RVEs.
fn rve(scene: &mut Scene) -> &mut Rve {
    match &mut scene.material {
        Material::Rve(rve) => rve,
        Material::Discs(_) | Material::MuI(_) | Material::Elastic(_) => {
            panic!("the scene's material must be rve")
        }
    }
}

fn p(scene: &mut Scene) -> &mut RveParameters {
    &mut rve(scene).parameters
}
