//! Column collapses against the scaling laws of experiments.

use plot::{Axis, Chart, Mark, Series};

use crate::context::Context;
use crate::literature::runout::LAWS;
use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::column_collapse::{ASPECTS, Collapse, Deposit, estimate, measure};
use crate::suite::Suite;
use crate::text::number;

/// Runout and height of columns over their aspect ratio.
pub struct ColumnCollapse;

impl Section for ColumnCollapse {
    fn title(&self) -> &'static str {
        "Column collapse against scaling laws"
    }

    fn lead(&self) -> &'static str {
        "How far columns of different heights spread, beside experiments with sand, discs and rods."
    }

    fn estimate(&self, context: &Context) -> f64 {
        estimate(context)
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let collapses = measure(context)?;
        let mut blocks = vec![headline(&collapses), description(), figure(&collapses)?];
        blocks.push(Block::Table(table(&collapses)));
        for Collapse { material, failures, .. } in &collapses {
            for (aspect, message) in failures {
                blocks.push(Block::text(format!("{material}, H / L0 = {aspect} failed:")));
                blocks.push(Block::Quote(message.clone()));
            }
        }
        if context.suite == Suite::Quick {
            blocks.push(Block::missing(
                "Packings",
                "they take minutes for each column on two cores.",
                "`--suite full` computes them.",
            ));
        }
        Ok(blocks)
    }
}

fn headline(collapses: &[Collapse]) -> Block {
    let law = |collapse: &Collapse| {
        let (factor, exponent) = collapse.law;
        format!("{} {} a^{}", collapse.material, number(factor), number(exponent))
    };
    let laws: Vec<String> = collapses.iter().map(law).collect();
    Block::headline(format!(
        "Runout (L - L0) / L0 of columns of aspect ratio a = H / L0 from 0.5 to 3, by least squares: \
         {}. Experiments: sand 1.2 a, then 1.9 a^(2/3); discs 2.5 a, then 3.25 a^0.7.",
        laws.join("; ")
    ))
}

fn description() -> Block {
    Block::text(
        "Columns of width L0 = 1 m and height H stand against a smooth wall on a floor with friction \
         0.5 and collapse until they rest, for 5.5 sqrt(H / g). Sand in a channel (Lube et al.) has \
         three dimensions and side walls; discs (Staron and Hinch) and rods are closer to what is \
         computed here. Balmforth and Kerswell (2005) found exponents of 0.9 +- 0.1 in wide and 0.65 \
         +- 0.05 in narrow slots.",
    )
}

fn figure(collapses: &[Collapse]) -> miette::Result<Block> {
    let aspects = (0..=20).map(|k| 0.4 * 10_f64.powf(0.05 * f64::from(k)));
    let mut series: Vec<Series> = LAWS
        .iter()
        .map(|law| {
            let points = aspects.clone().map(|a| (a, (law.runout)(a)));
            Series::new(law.name, Mark::Line, points.collect())
        })
        .collect();
    let marks = [Mark::Circles, Mark::Squares, Mark::Crosses, Mark::Triangles];
    for (collapse, mark) in collapses.iter().zip(marks) {
        let points = collapse.deposits.iter().map(|d| (d.aspect, d.runout)).collect();
        series.push(Series::new(collapse.material, mark, points));
    }
    let x = Axis::log("aspect ratio a = H / L0");
    let svg = Chart { x, y: Axis::log("runout (L - L0) / L0"), series, floor: None }.svg()?;
    Ok(Block::Figure(Figure::new(
        "Runout over aspect ratio",
        Picture::Svg(svg),
        "Lines: experiments and discrete simulations of others. Marks: this code.",
    )))
}

fn table(collapses: &[Collapse]) -> Table {
    let mut columns = vec!["H / L0".to_owned()];
    columns.extend(LAWS.iter().map(|law| law.name.to_owned()));
    for Collapse { material, .. } in collapses {
        columns.extend(["runout", "height"].map(|name| format!("{material}: {name}")));
    }
    let titles: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut table = Table::new("Runout and height", titles).note(
        "Laws: runout (L - L0) / L0. Ours: the same, and the height of the deposit over L0. L is the \
         edge of the foremost point.",
    );
    for aspect in ASPECTS {
        let laws = LAWS.iter().map(|law| number((law.runout)(aspect)));
        let ours = collapses.iter().flat_map(|collapse| {
            let found = collapse.deposits.iter().find(|deposit| deposit.aspect == aspect);
            let cell =
                |value: fn(&Deposit) -> f64| found.map_or(String::new(), |d| number(value(d)));
            [cell(|d| d.runout), cell(|d| d.height)]
        });
        table.row(std::iter::once(number(aspect)).chain(laws).chain(ours));
    }
    table
}
