//! The runs of a picture at the times that they have in common, as panels.

use plot::Curve;

use super::error::FigureError;
use super::options::{Compare, Options};
use super::panel::{Disc, Paint, Panel};
use super::quantity::Quantity;
use super::run::{Run, names};
use super::time_text::time_text;
use super::undrawn::{Undrawn, is_drawn};
use super::view::View;
use crate::comparison::{Parts, common_frames};
use crate::trajectory::{Frame, Trajectory};

/// Radius of the discs of a run over those of the run below it.
const SMALLER: f64 = 0.62;

/// One run, or several in comparison.
pub(super) struct Shown<'a> {
    pub runs: Vec<Run<'a>>,
    pub compare: Compare,
    pub quantity: Quantity,
    /// Whether colours show distances from the first run.
    pub shows_distance: bool,
    /// For each common time the frame of each run.
    pub frames: Vec<Vec<usize>>,
    /// The runs after the first in comparison with it; none for one of other material.
    others: Vec<Option<Other>>,
}

/// A run in comparison with the first.
struct Other {
    parts: Parts,
    /// Root mean square distance at each common time (m).
    distance: Vec<f64>,
}

impl<'a> Shown<'a> {
    /// # Errors
    /// If a file cannot be read, lacks the quantity, has no time in common with the others or, where differences are
    /// to be shown, other material.
    pub(super) fn new(
        trajectories: &'a [Trajectory],
        options: &Options,
    ) -> Result<Self, FigureError> {
        let compare = options.compare;
        let is_difference = compare == Compare::Difference && trajectories.len() > 1;
        if is_difference && options.grains {
            return Err(FigureError::DifferenceOfGrains);
        }
        let usual = if options.grains { Quantity::Layer } else { Quantity::Speed };
        let quantity = options.quantity.unwrap_or(usual);
        let runs = trajectories.iter().zip(names(trajectories));
        let runs: Vec<Run> = runs
            .map(|(trajectory, name)| Run::new(trajectory, name, quantity, options))
            .collect::<Result<_, _>>()?;
        let times: Vec<&[f64]> = trajectories.iter().map(Trajectory::time).collect();
        let mut frames = common_frames(&times);
        let has_grains = |frames: &Vec<usize>| {
            runs.iter().zip(frames).all(|(run, frame)| frame.is_multiple_of(run.bodies.every()))
        };
        frames.retain(has_grains);
        if frames.is_empty() {
            return Err(FigureError::NoCommonTime);
        }
        let mut shown = Self {
            runs,
            compare,
            quantity,
            shows_distance: is_difference && options.quantity.is_none(),
            frames,
            others: Vec::new(),
        };
        for k in 1..trajectories.len() {
            let [first, other] = [&trajectories[0], &trajectories[k]];
            let other = match Parts::of(other, first)? {
                Some(parts) => Some(shown.compared(k, parts)?),
                None if is_difference => {
                    let [one, other] = [other, first].map(|file| file.path().to_owned());
                    return Err(FigureError::OtherMaterial { one, other });
                }
                None => None,
            };
            shown.others.push(other);
        }
        Ok(shown)
    }

    /// The distances of a run from the first over time.
    fn compared(&self, run: usize, parts: Parts) -> Result<Other, FigureError> {
        let [one, first] = [run, 0].map(|run| self.runs[run].bodies.trajectory);
        let positions = |file: &Trajectory, frame: usize| -> Result<Vec<[f64; 2]>, FigureError> {
            let flat = file.positions(frame..frame + 1)?.into_raw_vec_and_offset().0;
            Ok(flat.as_chunks().0.to_vec())
        };
        let distance = |frames: &Vec<usize>| {
            Ok(parts.distance(&positions(one, frames[run])?, &positions(first, frames[0])?))
        };
        let distance = self.frames.iter().map(distance).collect::<Result<_, FigureError>>()?;
        Ok(Other { parts, distance })
    }

    /// Names of the runs whose material is not that of the first.
    pub(super) fn unlike(&self) -> Vec<String> {
        let others = self.runs.iter().skip(1).zip(&self.others);
        others.filter(|(_, other)| other.is_none()).map(|(run, _)| run.name.clone()).collect()
    }

    /// Panels for each time.
    pub(super) fn panels_a_time(&self) -> usize {
        match self.compare {
            Compare::Side => self.runs.len(),
            Compare::Overlay => 1,
            Compare::Difference => (self.runs.len() - 1).max(1),
        }
    }

    /// Time of a common frame (s).
    pub(super) fn time(&self, place: usize) -> f64 {
        self.runs[0].bodies.trajectory.time()[self.frames[place][0]]
    }

    /// The frames of all runs at a common time.
    fn read(&self, place: usize) -> Result<Vec<Frame>, FigureError> {
        let runs = self.runs.iter().zip(&self.frames[place]);
        runs.map(|(run, &frame)| run.bodies.frame(frame)).collect()
    }

    /// Grows a view and counts the points that a picture leaves out.
    pub(super) fn look(
        &self,
        place: usize,
        view: &mut View,
        undrawn: &mut Undrawn,
    ) -> Result<(), FigureError> {
        for (frame, &index) in self.read(place)?.iter().zip(&self.frames[place]) {
            view.include(&frame.position);
            undrawn.add(index, frame);
        }
        Ok(())
    }

    /// The panels of a common time.
    pub(super) fn panels(&self, place: usize) -> Result<Vec<Panel>, FigureError> {
        let frames = self.read(place)?;
        let runs = 0..self.runs.len();
        Ok(match self.compare {
            _ if self.runs.len() == 1 => vec![self.alone(0, &frames[0], place)],
            Compare::Side => runs.map(|run| self.alone(run, &frames[run], place)).collect(),
            Compare::Overlay => {
                let mut panel = self.panel(&frames[0], self.label(None, place, self.only(place)));
                panel.discs = runs.flat_map(|run| self.in_one_colour(run, &frames[run])).collect();
                vec![panel]
            }
            Compare::Difference => {
                runs.skip(1).map(|run| self.difference(run, &frames, place)).collect()
            }
        })
    }

    /// A run with the colours of its quantity.
    fn alone(&self, run: usize, frame: &Frame, place: usize) -> Panel {
        let name = (self.runs.len() > 1).then_some(run);
        let distance = run.checked_sub(1).and_then(|other| self.distance(other, place));
        let mut panel = self.panel(frame, self.label(name, place, distance));
        let values = self.runs[run].values(frame);
        let bodies = frame.position.iter().zip(self.runs[run].radii()).zip(values);
        let disc = |((&at, &radius), value)| Disc { at, radius, paint: Paint::Value(value) };
        panel.discs = bodies.map(disc).filter(|disc| is_drawn(&disc.at)).collect();
        panel
    }

    /// The discs of a run, smaller than those of the runs before.
    fn in_one_colour<'b>(
        &'b self,
        run: usize,
        frame: &'b Frame,
    ) -> impl Iterator<Item = Disc> + 'b {
        let shrunk = SMALLER.powi(run as i32);
        let bodies = frame.position.iter().zip(self.runs[run].radii());
        let disc = move |(&at, radius): (&[f64; 2], &f64)| Disc {
            at,
            radius: shrunk * radius,
            paint: Paint::Run(run),
        };
        bodies.map(disc).filter(|disc| is_drawn(&disc.at))
    }

    /// The parts of a run, with the colours of their distances or differences from the first run.
    fn difference(&self, run: usize, frames: &[Frame], place: usize) -> Panel {
        let distance = self.distance(run - 1, place);
        let mut panel = self.panel(&frames[run], self.label(Some(run), place, distance));
        let Some(Other { parts, .. }) = &self.others[run - 1] else { return panel };
        let [at, first] = parts.positions(&frames[run].position, &frames[0].position);
        let values: Vec<f64> = if self.shows_distance {
            let pairs = at.iter().zip(&first);
            pairs.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).collect()
        } else {
            let values = [run, 0].map(|run| self.runs[run].values(&frames[run]));
            let [values, first] = parts.values(&values[0], &values[1]);
            values.iter().zip(&first).map(|(a, b)| a - b).collect()
        };
        let discs = at.into_iter().zip(values).filter(|(at, _)| is_drawn(at));
        let radius = 0.5 * parts.side;
        let disc = |(at, value)| Disc { at, radius, paint: Paint::Value(value) };
        panel.discs = discs.map(disc).collect();
        panel
    }

    /// A panel without discs.
    fn panel(&self, frame: &Frame, label: String) -> Panel {
        let walls = self.runs[0].bodies.trajectory.header().walls.clone();
        Panel { discs: Vec::new(), boxes: frame.boxes.clone(), walls, label }
    }

    /// The distance of one of the other runs from the first.
    fn distance(&self, other: usize, place: usize) -> Option<f64> {
        self.others[other].as_ref().map(|other| other.distance[place])
    }

    /// The distance of the only other run.
    fn only(&self, place: usize) -> Option<f64> {
        if self.others.len() == 1 { self.distance(0, place) } else { None }
    }

    /// Name, time and distance.
    fn label(&self, run: Option<usize>, place: usize, distance: Option<f64>) -> String {
        let name = run.map(|run| self.runs[run].name.clone());
        let time = format!("t = {} s", time_text(self.time(place)));
        let distance = distance.map(|metres| format!("RMS {} m", plot::number(metres)));
        [name, Some(time), distance].into_iter().flatten().collect::<Vec<_>>().join("   ")
    }

    /// Distances from the first run over time, each with the number of its run.
    pub(super) fn curves(&self) -> Vec<(usize, Curve)> {
        let curve = |(k, other): (usize, &Option<Other>)| {
            let times = (0..self.frames.len()).map(|place| self.time(place));
            let points = times.zip(other.as_ref()?.distance.iter().copied()).collect();
            Some((k + 1, Curve { colour: plot::series_colour(k + 1), points }))
        };
        self.others.iter().enumerate().filter_map(curve).collect()
    }

    /// The title: that of the runs, or all of them where they differ.
    pub(super) fn title(&self) -> String {
        let titles = self.runs.iter().map(|run| &run.bodies.trajectory.header().title);
        let mut titles: Vec<String> = titles.map(|t| t.replace(char::is_control, " ")).collect();
        titles.dedup();
        titles.join(" | ")
    }
}
