//! Figures of several frames.

use std::path::Path;

use files::write_atomically;

use super::error::FigureError;
use super::figure::Figure;
use super::options::Options;
use super::panel::Panel;
use super::select;
use super::shown::Shown;
use super::undrawn::Undrawn;
use super::view::View;
use crate::trajectory::Trajectory;

/// Times of a figure by default.
const TIMES: usize = 4;
/// Most panels of a figure.
const MOST_PANELS: usize = 64;

/// Writes a PNG of the selected frames, by default four over the whole run, of one run or of several in comparison
/// with the first.
///
/// # Errors
/// If a frame or its field is missing, the runs cannot be compared or the file cannot be written.
pub fn draw(
    trajectories: &[Trajectory],
    options: &Options,
    output: &Path,
) -> Result<Undrawn, FigureError> {
    if output.extension().is_some_and(|suffix| !suffix.eq_ignore_ascii_case("png")) {
        return Err(FigureError::FigureFormat { path: output.to_owned() });
    }
    if let Some(trajectory) = trajectories.iter().find(|trajectory| trajectory.frames() == 0) {
        return Err(FigureError::Empty { path: trajectory.path().to_owned() });
    }
    let shown = Shown::new(trajectories, options)?;
    let chosen = select::places(&shown, &options.frames)?
        .unwrap_or_else(|| select::evenly(shown.frames.len(), TIMES));
    let count = chosen.len() * shown.panels_a_time();
    if count > MOST_PANELS {
        return Err(FigureError::TooManyPanels(count));
    }
    let panels = panels(&shown, &chosen)?;
    let (mut view, mut undrawn) = (View::EMPTY, Undrawn::unlike(&shown.unlike()));
    for &place in &chosen {
        shown.look(place, &mut view, &mut undrawn)?;
    }
    let figure = Figure::new(&shown, options, &panels, view, count, options.width.unwrap_or(1600));
    let times: Vec<f64> = chosen.iter().map(|&place| shown.time(place)).collect();
    let image = figure.draw(&panels, &times)?;
    // The temporary name has no suffix that tells the format.
    write_atomically(output, |temporary| {
        Ok::<_, FigureError>(image.save_with_format(temporary, image::ImageFormat::Png)?)
    })?;
    Ok(undrawn)
}

/// The panels of several times, one time after the other.
pub(super) fn panels(shown: &Shown<'_>, places: &[usize]) -> Result<Vec<Panel>, FigureError> {
    let panels = places.iter().map(|&place| shown.panels(place)).collect::<Result<Vec<_>, _>>()?;
    Ok(panels.into_iter().flatten().collect())
}
