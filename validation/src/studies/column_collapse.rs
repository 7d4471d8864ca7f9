//! Runout and height of collapsing columns over their aspect ratio.

use dempm::trajectory::Trajectory;
use toml::Value;

use crate::context::Context;
use crate::scene_text::with;
use crate::studies::statistics::{power_law, range};
use crate::suite::Suite;

/// Aspect ratios H / L0 of columns of width L0 = 1 m.
pub const ASPECTS: [f64; 4] = [0.5, 1.0, 2.0, 3.0];

/// What columns are made of.
pub struct Material {
    /// Name in the report.
    pub name: &'static str,
    /// `material.kind` of the scene.
    kind: &'static str,
    /// Cell of the grid, m.
    cell: f64,
}

const MATERIALS: [Material; 4] = [
    Material { name: "discs", kind: "discs", cell: 0.125 },
    Material { name: "mu(I)", kind: "mu-i", cell: 0.125 },
    Material { name: "mu(I), cells of 0.0625 m", kind: "mu-i", cell: 0.0625 },
    Material { name: "packings", kind: "rve", cell: 0.03125 },
];

/// A column after its collapse.
pub struct Deposit {
    /// Aspect ratio H / L0 before.
    pub aspect: f64,
    /// `(L - L0) / L0`, with L the edge of the foremost point.
    pub runout: f64,
    /// Height over L0.
    pub height: f64,
}

/// The columns of one material.
pub struct Collapse {
    /// Name of the material.
    pub material: &'static str,
    /// Deposits of the columns that ran to the end.
    pub deposits: Vec<Deposit>,
    /// Factor c and exponent n of `runout = c a^n`.
    pub law: (f64, f64),
    /// Aspect ratios of the others, and why they failed.
    pub failures: Vec<(f64, String)>,
}

/// Estimated time of what is not kept, s.
pub fn estimate(context: &Context) -> f64 {
    let scenes =
        materials(context.suite).flat_map(|material| ASPECTS.map(|aspect| scene(aspect, material)));
    scenes.map(|scene| context.estimate(&scene)).sum()
}

/// Collapses columns of all materials of the suite.
///
/// # Errors
/// If a run cannot be made or read, or the user interrupts.
pub fn measure(context: &mut Context) -> miette::Result<Vec<Collapse>> {
    materials(context.suite).map(|material| collapse(context, material)).collect()
}

fn collapse(context: &mut Context, material: &Material) -> miette::Result<Collapse> {
    let (mut deposits, mut failures) = (Vec::new(), Vec::new());
    for aspect in ASPECTS {
        let what = format!("column a = {aspect}, {}", material.name);
        let run = context.run(&what, &scene(aspect, material))?;
        if run.succeeded {
            deposits.push(deposit(aspect, &Trajectory::open(&run.output)?)?);
        } else {
            failures.push((aspect, run.message));
        }
    }
    let points: Vec<(f64, f64)> = deposits.iter().map(|d| (d.aspect, d.runout)).collect();
    Ok(Collapse { material: material.name, law: power_law(&points), deposits, failures })
}

fn materials(suite: Suite) -> impl Iterator<Item = &'static Material> {
    let quick = |material: &Material| material.kind == "mu-i" && material.cell == 0.125;
    MATERIALS.iter().filter(move |material| suite == Suite::Full || quick(material))
}

fn scene(aspect: f64, material: &Material) -> String {
    // Whole frames.
    let duration = (5.5 * (aspect / 9.81).sqrt() / 0.02).ceil() * 0.02;
    with(
        include_str!("../../../scenes/column.toml"),
        &[
            ("title", format!("Column, H / L0 = {aspect}").into()),
            ("duration", duration.into()),
            ("frame_interval", 0.02.into()),
            ("domain.size", Value::Array(vec![14.0.into(), 4.0.into()])),
            ("domain.cell", material.cell.into()),
            ("column", {
                let mut column = toml::Table::new();
                column.insert("corner".into(), Value::Array(vec![0.0.into(), 0.0.into()]));
                column.insert("size".into(), Value::Array(vec![1.0.into(), aspect.into()]));
                Value::Array(vec![column.into()])
            }),
            ("material.kind", material.kind.into()),
            ("output.fields", Value::Array(vec![])),
        ],
    )
}

fn deposit(aspect: f64, trajectory: &Trajectory) -> miette::Result<Deposit> {
    let last = trajectory.frame(trajectory.frames() - 1)?;
    let edge = 0.5 * trajectory.header().point_spacing;
    let largest = |k: usize| {
        let range = range(last.position.iter().map(|x| x[k]));
        range.map_or(f64::NAN, |[_, most]| most) + edge
    };
    Ok(Deposit { aspect, runout: largest(0) - 1.0, height: largest(1) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_columns_are_valid_scenes() {
        for material in &MATERIALS {
            for aspect in ASPECTS {
                dempm::scene::Scene::parse(&scene(aspect, material), "column.toml").unwrap();
            }
        }
    }
}
