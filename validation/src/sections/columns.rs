//! Column collapses against the scaling laws of experiments.

use dempm::trajectory::Trajectory;
use plot::{Axis, Chart, Mark, Series};
use toml::Value;

use crate::block::{Block, Figure, Table};
use crate::context::{Context, Suite};
use crate::scene::with;
use crate::section::Section;
use crate::table::number;

/// Runout and height of columns over their aspect ratio.
pub struct Columns;

/// A law of the literature: name, and runout (L - L0) / L0 of an aspect ratio.
type Law = (&'static str, fn(f64) -> f64);

const RUNOUTS: [Law; 3] = [
    ("Lube et al. 2005, sand", |a| if a < 2.3 { 1.2 * a } else { 1.9 * a.powf(2.0 / 3.0) }),
    ("Staron & Hinch 2005, discs", |a| if a < 2.0 { 2.5 * a } else { 3.25 * a.powf(0.7) }),
    ("aluminium rods, arXiv 1512.05180", |a| {
        if a < 1.5 { 3.25 * a.powf(0.96) } else { 3.80 * a.powf(0.73) }
    }),
];

/// Aspect ratios H / L0 of columns of width 1 m.
const ASPECTS: [f64; 4] = [0.5, 1.0, 2.0, 3.0];

/// What the columns are made of: name, kind, cell (m).
const MATERIALS: [(&str, &str, f64); 3] = [
    ("mu(I)", "mu-i", 0.125),
    ("mu(I), cells of 0.0625 m", "mu-i", 0.0625),
    ("packings", "rve", 0.125),
];

/// What became of a column.
struct Deposit {
    aspect: f64,
    runout: f64,
    height: f64,
}

impl Section for Columns {
    fn title(&self) -> &'static str {
        "Column collapse against scaling laws"
    }

    fn estimate(&self, context: &Context) -> f64 {
        let scenes = materials(context.suite)
            .flat_map(|(_, kind, cell)| ASPECTS.map(|aspect| scene(aspect, kind, *cell)));
        scenes.map(|scene| context.estimate(&scene)).sum()
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let mut columns = vec!["H / L0".to_owned()];
        columns.extend(RUNOUTS.map(|(name, _)| name.to_owned()));
        let mut rows: Vec<Vec<String>> = ASPECTS
            .iter()
            .map(|a| {
                let laws = RUNOUTS.map(|(_, law)| number(law(*a)));
                std::iter::once(number(*a)).chain(laws).collect()
            })
            .collect();
        let mut series: Vec<Series> = RUNOUTS
            .iter()
            .map(|(name, law)| {
                let places = (0..=20).map(|k| 0.4 * 10_f64.powf(0.05 * f64::from(k)));
                Series::new(*name, Mark::Line, places.map(|a| (a, law(a))).collect())
            })
            .collect();
        let mut exponents = Vec::new();
        let mut blocks = Vec::new();
        let marks = [Mark::Squares, Mark::Crosses, Mark::Circles];
        for ((name, kind, cell), mark) in materials(context.suite).zip(marks) {
            let mut deposits = Vec::new();
            for aspect in ASPECTS {
                let scene = scene(aspect, kind, *cell);
                let run = context.run(&format!("column a = {aspect}, {name}"), &scene)?;
                if run.succeeded {
                    deposits.push(deposit(aspect, &Trajectory::open(&run.output)?)?);
                } else {
                    blocks.push(Block::text(format!("{name}, H / L0 = {aspect} failed:")));
                    blocks.push(Block::Quote(run.message));
                }
            }
            for (title, value) in [("runout", runout as fn(&Deposit) -> f64), ("height", height)] {
                columns.push(format!("{name}: {title}"));
                for (row, aspect) in rows.iter_mut().zip(ASPECTS) {
                    let found = deposits.iter().find(|deposit| deposit.aspect == aspect);
                    row.push(found.map_or(String::new(), |deposit| number(value(deposit))));
                }
            }
            let points: Vec<(f64, f64)> = deposits.iter().map(|d| (d.aspect, d.runout)).collect();
            let (factor, exponent) = power_law(&points);
            exponents.push(format!("{name} {} a^{}", number(factor), number(exponent)));
            series.push(Series::new(*name, mark, points));
        }
        let picture = Chart {
            x: Axis::log("aspect ratio a = H / L0"),
            y: Axis::log("runout (L - L0) / L0"),
            series,
            floor: None,
        }
        .svg()
        .map(crate::figure::Picture::Svg)?;
        let titles: Vec<&str> = columns.iter().map(String::as_str).collect();
        let mut table = Table::new("Runout and height", titles).note(
            "Laws: runout (L - L0) / L0. Ours: the same, and the height of the deposit over L0. \
             L is the edge of the foremost point.",
        );
        rows.into_iter().for_each(|row| table.row(row));
        let mut all = vec![
            Block::text(
                "Columns of width L0 = 1 m stand against a smooth wall on a floor with friction 0.5 \
                 and collapse until rest, 5.5 sqrt(H / g). Sand in a channel (Lube et al.) has three \
                 dimensions and side walls; discs (Staron and Hinch) and rods are nearer to what is \
                 computed here. Balmforth and Kerswell (2005) found exponents of 0.9 +- 0.1 in wide \
                 and 0.65 +- 0.05 in narrow slots.",
            ),
            Block::Figure(Figure::new(
                "Runout over aspect ratio",
                picture,
                "Lines: experiments and discrete simulations of others. Marks: this code.",
            )),
            Block::Table(table),
        ];
        all.insert(
            0,
            Block::headline(format!(
                "Runout (L - L0) / L0 of columns of aspect ratio a = 0.5 to 3, by least squares: {}. \
                 Experiments: sand 1.2 a, then 1.9 a^(2/3); discs 2.5 a, then 3.25 a^0.7.",
                exponents.join("; ")
            )),
        );
        all.append(&mut blocks);
        if context.suite == Suite::Quick {
            all.push(Block::missing(
                "Packings",
                "they take minutes a column on two cores.",
                "`--suite full` computes them.",
            ));
        }
        Ok(all)
    }
}

fn runout(deposit: &Deposit) -> f64 {
    deposit.runout
}

fn height(deposit: &Deposit) -> f64 {
    deposit.height
}

fn materials(suite: Suite) -> impl Iterator<Item = &'static (&'static str, &'static str, f64)> {
    MATERIALS
        .iter()
        .filter(move |(_, kind, cell)| suite == Suite::Full || (*kind == "mu-i" && *cell == 0.125))
}

fn scene(aspect: f64, kind: &str, cell: f64) -> String {
    // Whole frames.
    let duration = (5.5 * (aspect / 9.81).sqrt() / 0.02).ceil() * 0.02;
    with(
        include_str!("../../../scenes/column.toml"),
        &[
            ("title", format!("Column, H / L0 = {aspect}").into()),
            ("duration", duration.into()),
            ("frame_interval", 0.02.into()),
            ("domain.size", Value::Array(vec![14.0.into(), 4.0.into()])),
            ("domain.cell", cell.into()),
            ("column", {
                let mut column = toml::Table::new();
                column.insert("corner".into(), Value::Array(vec![0.0.into(), 0.0.into()]));
                column.insert("size".into(), Value::Array(vec![1.0.into(), aspect.into()]));
                Value::Array(vec![column.into()])
            }),
            ("material.kind", kind.into()),
            ("output.fields", Value::Array(vec![])),
        ],
    )
}

fn deposit(aspect: f64, trajectory: &Trajectory) -> miette::Result<Deposit> {
    let last = trajectory.frame(trajectory.frames() - 1)?;
    let edge = 0.5 * trajectory.header().point_spacing;
    let largest = |k: usize| last.position.iter().map(|x| x[k]).fold(f64::MIN, f64::max) + edge;
    Ok(Deposit { aspect, runout: largest(0) - 1.0, height: largest(1) })
}

/// Factor and exponent of `y = c x^n`, by least squares of the logarithms.
fn power_law(points: &[(f64, f64)]) -> (f64, f64) {
    let count = points.len() as f64;
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let mean = |value: fn(&(f64, f64)) -> f64| logs.iter().map(value).sum::<f64>() / count;
    let (x, y) = (mean(|l| l.0), mean(|l| l.1));
    let slope = logs.iter().map(|l| (l.0 - x) * (l.1 - y)).sum::<f64>()
        / logs.iter().map(|l| (l.0 - x).powi(2)).sum::<f64>();
    ((y - slope * x).exp(), slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_recovered() {
        let points = [0.5, 1.0, 2.0, 4.0].map(|x: f64| (x, 1.7 * x.powf(1.3)));
        let (factor, exponent) = power_law(&points);
        assert!((factor - 1.7).abs() < 1e-12 && (exponent - 1.3).abs() < 1e-12);
    }

    #[test]
    fn all_columns_are_valid_scenes() {
        for (_, kind, cell) in MATERIALS {
            for aspect in ASPECTS {
                dempm::scene::Scene::parse(&scene(aspect, kind, cell), "column.toml").unwrap();
            }
        }
    }
}
