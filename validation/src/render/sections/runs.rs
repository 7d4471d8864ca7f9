//! Every run behind the report.

use crate::context::Context;
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::table::Table;
use crate::text::{number, seconds};

/// The runs of all sections.
pub struct Runs;

impl Section for Runs {
    fn title(&self) -> &'static str {
        "Runs behind this report"
    }

    fn lead(&self) -> &'static str {
        "All commands that were run, with their times and devices."
    }

    fn always(&self) -> bool {
        true
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let columns = [
            "run",
            "command",
            "ran on",
            "ended",
            "wall time",
            "processor time",
            "load per core",
            "build",
        ];
        let mut table = Table::new("Runs", columns).note(
            "Wall time of the whole process; comparisons of speed use the computation alone. Above a \
             load of 1, processes shared the cores and wall times are too long.",
        );
        for (place, run) in context.runs.iter().enumerate() {
            table.row([
                (place + 1).to_string(),
                format!("`{}`", run.command),
                run.about.as_ref().map_or(String::new(), |about| about.device.clone()),
                if run.succeeded { "well" } else { "with an error" }.to_owned(),
                seconds(run.seconds),
                run.processor_seconds.map_or(String::new(), seconds),
                run.load.map_or(String::new(), number),
                run.build.get(..8).unwrap_or(&run.build).to_owned(),
            ]);
        }
        Ok(vec![Block::Table(table)])
    }
}
