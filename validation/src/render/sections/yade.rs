//! The DEM against YADE, where that is installed.

use plot::{Axis, Chart, Mark, Series};

use crate::context::Context;
use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::yade::{Comparison, Found, measure};
use crate::text::{number, percent};

/// One packing, one shear path, two codes.
pub struct Yade;

/// Our precisions, and their names in the report.
const OURS: [(&str, &str); 2] = [("f64", "this code, f64"), ("f32", "this code, f32")];
/// Ranges of shear strain over which pressures are compared.
const RANGES: [[f64; 2]; 3] = [[0.0, 0.005], [0.005, 0.1], [0.1, 0.5]];

impl Section for Yade {
    fn title(&self) -> &'static str {
        "Constant-volume shear against YADE"
    }

    fn lead(&self) -> &'static str {
        "The same packing sheared in this code and in YADE, an established code for discrete elements."
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let Some(Comparison { version, processor, found }) = measure(context)? else {
            return Ok(vec![Block::missing(
                "The comparison with YADE",
                "the program `yade` is not installed.",
                "On Debian: `apt-get install yade`.",
            )]);
        };
        let ratio = |code| number(found.speed(code) / found.speed("yade"));
        Ok(vec![
            Block::headline(format!(
                "Up to a shear of 0.5 % the pressure of one packing (f64) differs by {}; then chaos \
                 separates all codes, f32 from f64 as well. On one thread this code makes {} (f64) \
                 and {} (f32) times as many disc-steps a second as YADE.",
                percent(found.difference("f64", RANGES[0])),
                ratio("f64"),
                ratio("f32"),
            )),
            Block::text(format!(
                "One dense packing of 400 discs at 20 kPa, simple shear at constant volume, the same \
                 steps in both codes (`validation/yade/compare.py`, {version}), one thread of \
                 {processor} each. Chaos separates the two at strains above 1 %: from there on only \
                 means can agree.",
            )),
            chart(&found, "pressure p [kPa]", |[_, p, _]| 1e-3 * p)?,
            chart(&found, "q / p", |[_, p, q]| q / p)?,
            Block::Table(table(&found)),
        ])
    }
}

fn table(found: &Found) -> Table {
    let mut table = Table::new(
        "Differences from YADE",
        ["code", "disc-steps/s", "over YADE", "p to 0.5 %", "p to 10 %", "p to 50 %"],
    )
    .note(
        "Speed on one thread each. Pressure: mean relative difference over strains up to 0.5 %, from \
         there to 10 %, and from there to 50 %.",
    );
    for (code, name) in OURS {
        let ratio = number(found.speed(code) / found.speed("yade"));
        let head = [name.to_owned(), format!("{:.2e}", found.speed(code)), ratio];
        let differences = RANGES.map(|range| percent(found.difference(code, range)));
        table.row(head.into_iter().chain(differences));
    }
    table.row(["YADE".to_owned(), format!("{:.2e}", found.speed("yade"))]);
    table
}

fn chart(found: &Found, label: &str, value: fn([f64; 3]) -> f64) -> miette::Result<Block> {
    let codes = OURS.into_iter().chain([("yade", "YADE")]);
    let line = |(code, name): (&str, &str)| {
        let path = found.path(code).iter();
        Series::new(name, Mark::Line, path.map(|row| (row[0], value(*row))).collect())
    };
    let (x, y) = (Axis::linear("shear strain"), Axis::linear(label));
    let svg = Chart { x, y, series: codes.map(line).collect(), floor: None }.svg()?;
    let caption = "One packing, one path; the lines separate where chaos has grown.";
    Ok(Block::Figure(Figure::new(format!("Path: {label}"), Picture::Svg(svg), caption)))
}
