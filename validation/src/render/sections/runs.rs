//! Every run that the report rests on.

use crate::block::{Block, Table};
use crate::context::Context;
use crate::section::Section;
use crate::table::{number, seconds};

pub struct Runs;

impl Section for Runs {
    fn title(&self) -> &'static str {
        "Runs behind this report"
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
            "Wall time of the process with everything, which speed is not judged by. Where more \
             than one process wanted each core, wall times are longer than they would be alone.",
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
                run.build[..8].to_owned(),
            ]);
        }
        Ok(vec![Block::Table(table)])
    }
}
