//! Log of a training: losses and validations, as tables and a chart.

use std::fmt::Write as _;
use std::path::Path;

use files::{WriteError, write_text};
use plot::{Axis, Chart, Mark, PlotError, Series};
use serde::{Deserialize, Serialize};

/// A log that cannot be written.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum LogError {
    /// The chart cannot be drawn.
    #[error(transparent)]
    Draw(#[from] PlotError),
    /// A file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}

/// Losses and validations up to a step. Part of a checkpoint, so a resumed training has one log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Log {
    rows: Vec<Row>,
    validations: Vec<(u64, f64)>,
    /// Sum and number of losses since the last row.
    pending: (f64, u64),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    step: u64,
    loss: f64,
    rate: f64,
}

impl Log {
    /// Adds losses to the next row.
    pub fn add(&mut self, losses: &[f64]) {
        for loss in losses {
            self.pending.0 += loss;
            self.pending.1 += 1;
        }
    }

    /// Completes a row after `step` steps, and returns the mean loss since the last one.
    pub fn row(&mut self, step: u64, rate: f64) -> f64 {
        let loss = self.pending.0 / self.pending.1.max(1) as f64;
        self.pending = (0.0, 0);
        self.rows.push(Row { step, loss, rate });
        loss
    }

    /// Adds a validation MSE (box²).
    pub fn validation(&mut self, step: u64, mse: f64) {
        self.validations.push((step, mse));
    }

    /// Mean losses of the rows.
    pub fn losses(&self) -> impl Iterator<Item = f64> + '_ {
        self.rows.iter().map(|row| row.loss)
    }

    /// Writes `log.csv`, `validation.csv` and `loss.svg`.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), LogError> {
        let mut losses = "step,loss,rate\n".to_owned();
        for Row { step, loss, rate } in &self.rows {
            // Writing to a string cannot fail.
            let _ = writeln!(losses, "{step},{loss:.6e},{rate:.6e}");
        }
        let mut validations = "step,mse\n".to_owned();
        for (step, mse) in &self.validations {
            let _ = writeln!(validations, "{step},{mse:.6e}");
        }
        for (name, text) in [("log.csv", losses), ("validation.csv", validations)] {
            write_text(&folder.join(name), &text)?;
        }
        write_text(&folder.join("loss.svg"), &self.chart().svg()?)?;
        Ok(())
    }

    fn chart(&self) -> Chart {
        let losses = self.rows.iter().map(|row| (row.step as f64, row.loss)).collect();
        let validations = self.validations.iter().map(|&(step, mse)| (step as f64, mse)).collect();
        Chart {
            x: Axis::linear("step"),
            y: Axis::log("loss, MSE"),
            series: vec![
                Series::new("loss", Mark::Line, losses),
                Series::new("MSE of validation rollouts [box²]", Mark::Reference, validations),
            ],
            floor: None,
        }
    }
}
