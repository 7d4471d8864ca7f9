//! Checks on the geometry: whole cells, bodies inside the domain, no overlaps.

use super::log::Log;
use super::model::{Material, Rectangle, Scene};
use super::problem::Problem;
use super::range::MAX_CELLS;

/// Tolerance of lengths, relative to a cell or spacing.
const TOLERANCE: f64 = 1.0e-6;
/// More points than any machine holds RVEs for: a wrong cell size must not take all memory.
const MAX_POINTS: f64 = 1.0e7;
/// Bodies are compared pair by pair.
const MAX_BODIES: usize = 1000;

/// `ratio` as a whole number, if it is one but for round-off.
pub(super) fn whole(ratio: f64) -> Option<u64> {
    let near = (ratio - ratio.round()).abs() <= TOLERANCE.max(1.0e-9 * ratio);
    (near && ratio < 1.0e15).then_some(ratio.round() as u64)
}

/// A rectangle with the path of its keys and a name for messages.
struct Body {
    path: String,
    name: String,
    place: Rectangle,
}

pub(super) fn validate(scene: &Scene, log: &Log) {
    domain(scene, log);
    let columns = columns(scene, log);
    let boxes = boxes(scene, log);
    if scene.columns.len() + scene.obstacles.len() > MAX_BODIES {
        log.report(Problem::error(format!("more than {MAX_BODIES} columns and obstacles")));
        return;
    }
    for body in columns.iter().chain(&boxes) {
        inside(scene, log, body);
    }
    let all: Vec<&Body> = columns.iter().chain(&boxes).collect();
    for (k, a) in all.iter().enumerate() {
        for b in &all[k + 1..] {
            if a.place.overlaps(&b.place, TOLERANCE * scene.domain.cell) {
                log.report(
                    Problem::error(format!("{} and {} overlap", a.name, b.name))
                        .at(log.place(&format!("{}.size", a.path)), span(&a.name, a.place))
                        .at(log.place(&format!("{}.size", b.path)), span(&b.name, b.place))
                        .help("move one by its `corner`, or change a `size`; they may touch"),
                );
            }
        }
    }
}

/// The place of a rectangle in words.
fn span(name: &str, place: Rectangle) -> String {
    let ([left, bottom], [right, top]) = (place.corner, place.end());
    format!("{name} is at x = {left} to {right} m, y = {bottom} to {top} m")
}

fn domain(scene: &Scene, log: &Log) {
    let domain = &scene.domain;
    let cells = domain.size.map(|size| size / domain.cell);
    if cells.iter().any(|&n| whole(n).is_none_or(|n| n == 0)) {
        let near = domain.size.map(|size| (size / domain.cell).round().max(1.0) * domain.cell);
        log.report(
            Problem::error("the domain is not a whole number of cells")
                .at(
                    log.place("domain.size"),
                    format!("{:.6} x {:.6} cells of {} m", cells[0], cells[1], domain.cell),
                )
                .help(format!("nearest: size = {near:?}")),
        );
    } else if cells[0] * cells[1] > MAX_CELLS {
        log.report(
            Problem::error(format!("{:.3e} cells are too many", cells[0] * cells[1]))
                .at(log.place("domain.cell").or(log.place("domain.size")), "cells of this size")
                .help("metres; the smallest useful cell is about the size of an RVE, 0.1 m"),
        );
    }
}

fn columns(scene: &Scene, log: &Log) -> Vec<Body> {
    if scene.columns.is_empty() {
        log.report(
            Problem::error("the scene has no material points")
                .at(log.place("column"), "no column")
                .help("add a [[column]] and below it size = [3.0, 3.0]"),
        );
    }
    let spacing = scene.domain.spacing();
    let mut points = 0.0;
    let mut bodies = Vec::new();
    for (k, column) in scene.columns.iter().enumerate() {
        let path = format!("column[{k}]");
        let grid = column.place.size.map(|size| size / spacing);
        if grid.iter().any(|&n| whole(n).is_none_or(|n| n == 0)) {
            let near = column.place.size.map(|size| (size / spacing).round().max(1.0) * spacing);
            log.report(
                Problem::error("the column is not a whole number of points")
                    .at(
                        log.place(&format!("{path}.size")),
                        format!("{:.6} x {:.6} points", grid[0], grid[1]),
                    )
                    .help(format!(
                        "points are {spacing} m apart (cell / points_per_cell); nearest: size = {near:?}"
                    )),
            );
        }
        points += grid[0] * grid[1];
        bodies.push(Body { path, name: format!("column {}", k + 1), place: column.place });
    }
    if points > MAX_POINTS {
        log.report(
            Problem::error(format!("{points:.3e} material points are too many"))
                .at(log.place("domain.cell"), "the cell sets their distance")
                .help(format!("at most {MAX_POINTS:e}; a larger `cell` gives fewer")),
        );
    }
    bodies
}

fn boxes(scene: &Scene, log: &Log) -> Vec<Body> {
    let mut bodies = Vec::new();
    for (k, obstacle) in scene.obstacles.iter().enumerate() {
        let path = format!("obstacle[{k}]");
        let (corner, end) = (obstacle.place.corner, obstacle.place.end());
        let lines = [corner[0], corner[1], end[0], end[1]].map(|x| x / scene.domain.cell);
        if has_grid(scene) && lines.iter().any(|&x| whole(x.abs()).is_none()) {
            log.report(
                Problem::warning("the obstacle is not on lines of the background grid")
                    .at(log.place(&format!("{path}.corner")), "corner and size decide its faces")
                    .help(format!(
                        "contact acts at grid nodes, so faces are felt at the nearest node inside; \
                         whole multiples of the cell, {} m, are exact",
                        scene.domain.cell
                    )),
            );
        }
        thick(scene, log, &path, "the obstacle", obstacle.place);
        bodies.push(Body { path, name: format!("obstacle {}", k + 1), place: obstacle.place });
    }
    if let Some(plate) = &scene.plate {
        thick(scene, log, "plate", "the plate", plate.place);
        if plate.start >= scene.duration {
            log.report(
                Problem::warning("the plate never moves")
                    .at(log.place("plate.start"), format!("the run ends at {} s", scene.duration))
                    .help("seconds; start before the end of `duration`"),
            );
        }
        let end = plate.at(scene.duration);
        if outside(scene, end) {
            log.report(
                Problem::warning("the plate leaves the domain before the run ends")
                    .at(log.place("plate.velocity"), span("in the end the plate", end)),
            );
        }
        bodies.push(Body { path: "plate".into(), name: "the plate".into(), place: plate.place });
    }
    bodies
}

/// Whether contact acts on the background grid.
fn has_grid(scene: &Scene) -> bool {
    !matches!(scene.material, Material::Discs(_))
}

/// Warns of thin boxes: material on both sides shares grid nodes.
fn thick(scene: &Scene, log: &Log, path: &str, name: &str, place: Rectangle) {
    let least = 2.0 * scene.domain.cell;
    if has_grid(scene) && place.size.iter().any(|size| *size < least * (1.0 - TOLERANCE)) {
        log.report(
            Problem::warning(format!("{name} is thinner than two cells"))
                .at(log.place(&format!("{path}.size")), span(name, place))
                .help(format!(
                    "material on one side of it feels material on the other; at least {least} m"
                )),
        );
    }
}

fn outside(scene: &Scene, place: Rectangle) -> bool {
    let tolerance = TOLERANCE * scene.domain.cell;
    (0..2)
        .any(|k| place.corner[k] < -tolerance || place.end()[k] > scene.domain.size[k] + tolerance)
}

fn inside(scene: &Scene, log: &Log, body: &Body) {
    if outside(scene, body.place) {
        let at = log.place(&format!("{}.size", body.path));
        let [width, height] = scene.domain.size;
        log.report(
            Problem::error(format!("{} is not inside the domain", body.name))
                .at(at, span(&body.name, body.place))
                .help(format!("the domain is x = 0 to {width} m, y = 0 to {height} m")),
        );
    }
}
