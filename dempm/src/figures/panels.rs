//! Figures of several frames.

use std::path::Path;

use files::write_atomically;

use super::bodies::Bodies;
use super::error::FigureError;
use super::figure::{Figure, Panel};
use super::options::Options;
use super::quantity::{Evaluator, Quantity};
use super::select;
use super::undrawn::Undrawn;
use crate::trajectory::Trajectory;

/// Panels of a figure by default.
const PANELS: usize = 4;
/// Most panels of a figure.
const MOST_PANELS: usize = 64;

/// Writes a PNG of the selected frames, by default four over the whole run. Returns the points left out.
///
/// # Errors
/// If a frame or its field is missing or the file cannot be written.
pub fn draw(
    trajectory: &Trajectory,
    options: &Options,
    output: &Path,
) -> Result<Undrawn, FigureError> {
    if output.extension().is_some_and(|suffix| !suffix.eq_ignore_ascii_case("png")) {
        return Err(FigureError::FigureFormat { path: output.to_owned() });
    }
    if trajectory.frames() == 0 {
        return Err(FigureError::Empty { path: trajectory.path().to_owned() });
    }
    let bodies = Bodies::of(trajectory, options.grains)?;
    let chosen = select::frames(&bodies, &options.frames)?.unwrap_or_else(|| {
        let all = select::all(&bodies);
        select::evenly(all.len(), PANELS).into_iter().map(|place| all[place]).collect()
    });
    if chosen.len() > MOST_PANELS {
        return Err(FigureError::TooManyPanels(chosen.len()));
    }
    let panels = panels(&bodies, options.quantity, &chosen)?;
    let width = options.width.unwrap_or(1600);
    let figure = Figure::new(&bodies, options, &panels, width);
    let image = figure.draw(&panels)?;
    // The temporary name has no suffix that tells the format.
    write_atomically(output, |temporary| {
        Ok::<_, FigureError>(image.save_with_format(temporary, image::ImageFormat::Png)?)
    })?;
    let mut undrawn = Undrawn::default();
    for (&index, panel) in std::iter::zip(&chosen, &panels) {
        undrawn.add(index, panel.frame());
    }
    Ok(undrawn)
}

/// Reads frames and evaluates the quantity in them.
pub(super) fn panels(
    bodies: &Bodies<'_>,
    quantity: Quantity,
    chosen: &[usize],
) -> Result<Vec<Panel>, FigureError> {
    let evaluator = Evaluator::new(bodies, quantity)?;
    chosen.iter().map(|&index| Ok(Panel::new(bodies.frame(index)?, &evaluator))).collect()
}
