//! The scene of an imported trajectory: its domain and boxes, as rollouts need them.

use std::fmt::Write as _;

use ndarray::Array3;

use super::bodies::{Bodies, Body};

/// Highest speed of waves in the default law, m/s; bounds the step of a valid scene.
const WAVES: f64 = 100.0;

/// The grid of an imported scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    /// Edge of a cell, m.
    pub cell: f64,
    /// Size of the domain, m: whole cells.
    pub domain: [f64; 2],
}

impl Grid {
    /// Cells of about half the connectivity radius (m), as many as it takes to fill a domain of `size` (m)
    /// best: its upper wall is less than a cell too high.
    pub fn fit(size: [f64; 2], radius: f64) -> Self {
        let coarsest = (size[0] / (0.5 * radius)).round().max(1.0);
        let candidates = (0..coarsest as usize).map(|more| {
            let cell = size[0] / (coarsest + more as f64);
            // But for round-off.
            let rows = (size[1] / cell - 1e-6).ceil().max(1.0);
            Self { cell, domain: [size[0], rows * cell] }
        });
        let excess = |grid: &Self| ((grid.domain[1] - size[1]) / size[1]).max(1e-9);
        let best = candidates.min_by(|a, b| excess(a).total_cmp(&excess(b)));
        best.unwrap_or(Self { cell: size[0], domain: size })
    }
}

/// A scene as TOML text. `material` are positions in m (frames x particles x 2), `interval` is the time
/// between frames, s. `None` if no place is free for the column that every scene has.
pub(super) fn scene_text(
    title: &str,
    grid: Grid,
    bodies: &Bodies,
    material: &Array3<f64>,
    interval: f64,
) -> Option<String> {
    let Grid { cell, domain } = grid;
    let [x, y] = free_cell(grid, bodies, material)?;
    let steps = (interval * WAVES / (0.2 * cell)).ceil().max(1.0);
    let (step, duration) = (interval / steps, interval * (material.dim().0 - 1) as f64);
    let mut text = format!(
        "# Imported: material and gravity are not known. The column is no more than one cell at a\n\
         # particle, since a scene needs one.\n\
         title = {}\nduration = {duration:?}\nframe_interval = {interval:?}\nstep = {step:?}\n\
         gravity = [0.0, 0.0]\n\n\
         [domain]\nsize = {domain:?}\ncell = {cell:?}\n\n\
         [[column]]\ncorner = [{x:?}, {y:?}]\nsize = [{cell:?}, {cell:?}]\n\n\
         [material]\nkind = \"mu-i\"\n\n[output]\nfields = []\n",
        toml::Value::from(title)
    );
    for body in bodies.boxes().iter().filter(|body| body.path.is_empty()) {
        // Writing to a string cannot fail.
        let _ = write!(text, "\n[[obstacle]]\n{}", rectangle(clipped(body.place, domain)?));
    }
    if let Some((body, [u, v], start)) = plate(bodies, interval, cell) {
        let _ = write!(
            text,
            "\n[plate]\n{}velocity = [{u:?}, {v:?}]\nstart = {start:?}\n",
            rectangle(clipped(body.place, domain)?)
        );
    }
    Some(text)
}

/// Corner and size of a rectangle as TOML.
fn rectangle([left, bottom, right, top]: [f64; 4]) -> String {
    format!("corner = [{left:?}, {bottom:?}]\nsize = [{:?}, {:?}]\n", right - left, top - bottom)
}

/// The part of a rectangle inside the domain, if any.
fn clipped(place: [f64; 4], domain: [f64; 2]) -> Option<[f64; 4]> {
    let clip = |k: usize| place[k].clamp(0.0, domain[k % 2]);
    let [left, bottom, right, top] = [clip(0), clip(1), clip(2), clip(3)];
    (right > left && top > bottom).then_some([left, bottom, right, top])
}

/// The corner of a square cell around a particle that no box covers.
fn free_cell(grid: Grid, bodies: &Bodies, material: &Array3<f64>) -> Option<[f64; 2]> {
    let Grid { cell, domain } = grid;
    let free = |[x, y]: [f64; 2]| {
        bodies.boxes().iter().all(|body| {
            let [left, bottom, right, top] = body.place;
            x + cell <= left || x >= right || y + cell <= bottom || y >= top
        })
    };
    let mut corners = (0..material.dim().1).map(|particle| {
        [0, 1].map(|k| (material[[0, particle, k]] - 0.5 * cell).clamp(0.0, domain[k] - cell))
    });
    corners.find(|&corner| free(corner))
}

/// The only moving box, if it is at rest until a time (s) and then moves at a constant velocity (m/s). A
/// plate of a scene moves so.
pub(super) fn plate(bodies: &Bodies, interval: f64, cell: f64) -> Option<(&Body, [f64; 2], f64)> {
    let mut moving = bodies.boxes().iter().filter(|body| !body.path.is_empty());
    let (Some(body), None) = (moving.next(), moving.next()) else { return None };
    let path = &body.path;
    let still = 1e-3 * cell;
    let rests = path.iter().take_while(|[x, y]| x.hypot(*y) < still).count();
    let (first, last) = (*path.get(rests)?, *path.last()?);
    let frames = (path.len() - 1).checked_sub(rests).filter(|&frames| frames > 0)?;
    let velocity = [0, 1].map(|k| (last[k] - first[k]) / (frames as f64 * interval));
    let speed = velocity[0].hypot(velocity[1]);
    let start = (rests as f64 * interval - first[0].hypot(first[1]) / speed).max(0.0);
    let at = |frame: usize| (frame as f64 * interval - start).max(0.0);
    let fits = |frame: usize| {
        (0..2).all(|k| (velocity[k] * at(frame) - path[frame][k]).abs() < 0.1 * cell)
    };
    (speed > 0.0 && (0..path.len()).all(fits)).then_some((body, velocity, start))
}
