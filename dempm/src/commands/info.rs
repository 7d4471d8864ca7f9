//! `dempm info`: prints a summary of a trajectory file.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

use files::print_result;
use serde::Serialize;

use super::start::{Layer, start_profile, table};
use super::terminal::print_json;
use crate::fronts::mass_front;
use crate::trajectory::{Field, Result, Trajectory};

/// Arguments of `dempm info`.
#[derive(clap::Args)]
pub struct InfoArgs {
    /// Trajectory file (HDF5).
    pub file: PathBuf,
    /// Print the summary as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Prints a summary of a trajectory.
///
/// # Errors
/// If it cannot be read, or nobody takes the summary.
pub fn info(args: &InfoArgs) -> miette::Result<()> {
    let info = Info::of(&Trajectory::open(&args.file)?)?;
    match args.json {
        true => print_json(&info),
        false => Ok(print_result(info.text())?),
    }
}

/// A trajectory in numbers, in SI units.
#[derive(Debug, Serialize)]
struct Info {
    file: PathBuf,
    title: String,
    seed: u64,
    status: String,
    warnings: Vec<String>,
    created: String,
    versions: BTreeMap<String, String>,
    device: String,
    precision: String,
    material: String,
    /// Number of points.
    points: usize,
    /// Initial distance between them (m).
    point_spacing: f64,
    /// Mass of all (kg/m).
    mass: f64,
    grains: Option<Grains>,
    /// Width and height (m).
    domain: [f64; 2],
    grid_cell: f64,
    parameters: BTreeMap<String, f64>,
    /// Number of frames.
    frames: usize,
    /// Times of the first frame and the last (s).
    time: Option<[f64; 2]>,
    frame_interval: f64,
    time_step: f64,
    /// From when on frames repeat a state at rest (s).
    rest_time: Option<f64>,
    end: Option<End>,
    /// Wall time of each phase (s).
    wall_time: BTreeMap<String, f64>,
    /// Bytes of the file, and of its fields without compression.
    file_size: u64,
    field_size: u64,
    /// The state at the start by height.
    start: Vec<Layer>,
    fields: Vec<FieldRange>,
    /// Least and largest value of each scalar of the whole scene.
    budget: BTreeMap<String, [f64; 2]>,
}

/// The grains of a trajectory.
#[derive(Debug, Serialize)]
struct Grains {
    count: usize,
    /// Frames from one with grains to the next.
    every: usize,
    /// Bytes in the file.
    size: u64,
}

/// The last frame. Fronts and height are those of the edges of points (m).
#[derive(Debug, Serialize)]
struct End {
    front: f64,
    /// Of 99 % of the mass.
    mass_front: f64,
    /// Of what a layer connects to the pile.
    connected_front: Option<f64>,
    height: f64,
}

/// The values of a field over all frames.
#[derive(Debug, Serialize)]
struct FieldRange {
    name: &'static str,
    unit: &'static str,
    components: Vec<ComponentRange>,
    /// Bytes in the file.
    size: u64,
    /// Values that are not finite, but for infinite inertial numbers.
    not_finite: usize,
    /// Frame and point of the first of them.
    first_not_finite: Option<(usize, usize)>,
}

/// The values of a component of a field.
#[derive(Debug, Serialize)]
struct ComponentRange {
    name: &'static str,
    min: f64,
    max: f64,
}

impl Info {
    /// Reads every frame once.
    fn of(trajectory: &Trajectory) -> Result<Self> {
        let header = trajectory.header().clone();
        let grains = match (trajectory.grain_count(), trajectory.grain_interval()) {
            (Some(count), Some(every)) => {
                Some(Grains { count, every, size: trajectory.stored_grain_bytes() })
            }
            _ => None,
        };
        let warnings = trajectory.warnings().unwrap_or_default();
        let bounds = |values: &Vec<f64>| {
            [f64::min, f64::max].map(|pick| values.iter().copied().fold(f64::NAN, pick))
        };
        let budget = trajectory.budget().iter().map(|(name, v)| (name.clone(), bounds(v)));
        let (first, last) = (trajectory.time().first(), trajectory.time().last());
        Ok(Self {
            file: trajectory.path().to_owned(),
            status: trajectory.status().to_owned(),
            warnings: warnings.into_iter().map(str::to_owned).collect(),
            points: trajectory.points().mass.len(),
            mass: trajectory.points().mass.iter().sum(),
            grains,
            frames: trajectory.frames(),
            time: first.zip(last).map(|(&first, &last)| [first, last]),
            end: end(trajectory)?,
            wall_time: trajectory.wall_time().clone(),
            file_size: trajectory.file_size(),
            field_size: raw_bytes(trajectory),
            start: start_profile(trajectory)?,
            fields: fields(trajectory)?,
            budget: budget.collect(),
            title: header.title,
            seed: header.seed,
            created: header.created,
            versions: header.versions,
            device: header.device,
            precision: header.precision,
            material: header.material,
            point_spacing: header.point_spacing,
            domain: header.domain,
            grid_cell: header.grid_cell,
            parameters: header.parameters,
            frame_interval: header.frame_interval,
            time_step: header.time_step,
            rest_time: trajectory.rest_time(),
        })
    }

    /// The summary for people.
    fn text(&self) -> String {
        let mut text = Text::default();
        text.line("file", self.file.display());
        text.line("scene", format_args!("{} (seed {})", self.title, self.seed));
        text.line("status", &self.status);
        for warning in &self.warnings {
            text.line("warning", warning);
        }
        text.line("created", &self.created);
        text.line("made by", pairs(&self.versions, Clone::clone));
        text.line("device", format_args!("{}, precision {}", self.device, self.precision));
        text.line("material", &self.material);
        let [spacing, mass] = [self.point_spacing, self.mass].map(number);
        text.line("points", format_args!("{}, {spacing} m apart, {mass} kg/m", self.points));
        if let Some(Grains { count, every, size }) = &self.grains {
            let (every, size) = (nth(*every), *size as f64 / 1e6);
            text.line("grains", format_args!("{count}, in every {every}, {size:.2} MB"));
        }
        let [width, height, cell] = [self.domain[0], self.domain[1], self.grid_cell].map(number);
        text.line("domain", format_args!("{width} m x {height} m, grid cell {cell} m"));
        if !self.parameters.is_empty() {
            text.line("parameters", pairs(&self.parameters, |&value| number(value)));
        }
        text.line("frames", self.frames_text());
        if let Some([_, strayed]) = self.budget.get("sleep_audit") {
            let text_of_audit =
                format!("{} mm at most beside sleeping grains", number(1e3 * strayed));
            text.line("sleep audit", text_of_audit);
        }
        if let Some(time) = self.rest_time {
            let text_of_rest = format!("from {} s on, which later frames repeat", number(time));
            text.line("at rest", text_of_rest);
        }
        if let Some(end) = &self.end {
            text.line("final front", format_args!("{} m", number(end.front)));
            text.line("front of 99 %", format_args!("{} m", number(end.mass_front)));
            if let Some(front) = end.connected_front {
                text.line("front of pile", format_args!("{} m", number(front)));
            }
            text.line("final height", format_args!("{} m", number(end.height)));
        }
        text.line("wall time", wall_time(&self.wall_time));
        let [size, raw] = [self.file_size, self.field_size].map(|bytes| bytes as f64 / 1e6);
        text.line("file size", format_args!("{size:.2} MB for {raw:.2} MB of data"));
        text.0 += &table(&self.start);
        self.ranges(&mut text);
        text.0
    }

    fn frames_text(&self) -> String {
        let span = self.time.map_or(String::new(), |time| {
            let [first, last] = time.map(number);
            format!(" from {first} to {last} s")
        });
        let [interval, step] = [self.frame_interval, self.time_step].map(number);
        format!("{}{span}, one every {interval} s, time step {step} s", self.frames)
    }

    /// Least and largest value of every component of every field, and of every scalar.
    fn ranges(&self, text: &mut Text) {
        let _ = writeln!(
            text.0,
            "\n{:<24}{:>14}{:>14}  {:<5}{:>12}",
            "field", "min", "max", "", "size"
        );
        for field in &self.fields {
            for (index, component) in field.components.iter().enumerate() {
                let name = format!("{} {}", field.name, component.name);
                let size = match index {
                    0 => format!("{:.2} MB", field.size as f64 / 1e6),
                    _ => String::new(),
                };
                let [low, high] = [component.min, component.max].map(number);
                let line = format!("{name:<24}{low:>14}{high:>14}  {:<5}{size:>12}", field.unit);
                let _ = writeln!(text.0, "{}", line.trim_end());
            }
            if let Some((frame, point)) = field.first_not_finite {
                let _ = writeln!(
                    text.0,
                    "{:<24}{:>14} values are not finite, the first at frame {frame}, point {point}",
                    "", field.not_finite
                );
            }
        }
        for (name, bounds) in &self.budget {
            let (name, [low, high]) = (name.replace(char::is_control, " "), bounds.map(number));
            let _ = writeln!(text.0, "{name:<24}{low:>14}{high:>14}");
        }
    }
}

/// The state of the last frame, from the positions, as trajectories of other programs may lack these scalars.
fn end(trajectory: &Trajectory) -> Result<Option<End>> {
    let Some(last) = trajectory.frames().checked_sub(1) else { return Ok(None) };
    let position = trajectory.frame(last)?.position;
    // The edge of the outermost point, as in the summary of `dempm run`.
    let half = 0.5 * trajectory.header().point_spacing;
    let most = |axis: usize| {
        let finite = position.iter().map(|x| x[axis]).filter(|x| x.is_finite());
        finite.fold(f64::NAN, f64::max) + half
    };
    let connected = trajectory.budget().get("front_connected");
    Ok(Some(End {
        front: most(0),
        mass_front: mass_front(&position, &trajectory.points().mass) + half,
        connected_front: connected.and_then(|front| front.get(last)).copied(),
        height: most(1),
    }))
}

/// "frame", or such as "10th frame".
fn nth(every: usize) -> String {
    let ending = match (every % 10, every % 100) {
        (_, 11..=13) => "th",
        (1, _) => "st",
        (2, _) => "nd",
        (3, _) => "rd",
        _ => "th",
    };
    if every == 1 { "frame".to_owned() } else { format!("{every}{ending} frame") }
}

/// Total wall time, and the share of each phase.
fn wall_time(phases: &BTreeMap<String, f64>) -> String {
    if phases.is_empty() {
        return "not recorded".to_owned();
    }
    let total: f64 = phases.values().sum();
    let share = |seconds: &f64| format!("{seconds:.2} s ({:.0} %)", 100.0 * seconds / total);
    format!("{total:.2} s: {}", pairs(phases, share))
}

/// The values of every field; reads every frame once.
fn fields(trajectory: &Trajectory) -> Result<Vec<FieldRange>> {
    trajectory.fields().map(|field| field_range(trajectory, field)).collect()
}

fn field_range(trajectory: &Trajectory, field: Field) -> Result<FieldRange> {
    let names = field.components();
    let mut bounds = vec![[f64::NAN; 2]; names.len()];
    let (mut not_finite, mut first_not_finite) = (0, None);
    for index in 0..trajectory.frames() {
        let values = trajectory.field::<f64>(field, index..index + 1)?;
        for (place, &value) in values.iter().flatten().enumerate() {
            let [low, high] = &mut bounds[place % names.len()];
            *low = low.min(value);
            *high = high.max(value);
            // Where a point deforms without pressure its inertial number is infinite.
            if value.is_nan() || value.is_infinite() && field != Field::InertialNumber {
                not_finite += 1;
                first_not_finite.get_or_insert((index, place / names.len()));
            }
        }
    }
    let component =
        |(&name, [min, max]): (&&'static str, [f64; 2])| ComponentRange { name, min, max };
    Ok(FieldRange {
        name: field.name(),
        unit: field.unit(),
        components: std::iter::zip(names, bounds).map(component).collect(),
        size: trajectory.stored_bytes(field),
        not_finite,
        first_not_finite,
    })
}

/// The size of the fields without compression.
fn raw_bytes(trajectory: &Trajectory) -> u64 {
    let (frames, points) = (trajectory.frames() as u64, trajectory.points().mass.len() as u64);
    let width = |field: Field| {
        let bytes = if Field::OPTIONAL.contains(&field) { 4 } else { 8 };
        bytes * field.components().len() as u64
    };
    let of_points: u64 = trajectory.fields().map(|field| width(field) * frames * points).sum();
    let of_grains = match (trajectory.grain_count(), trajectory.grain_interval()) {
        (Some(count), Some(every)) => 20 * count as u64 * frames.div_ceil(every as u64),
        _ => 0,
    };
    of_points + of_grains
}

/// Lines of a name and a value.
#[derive(Default)]
struct Text(String);

impl Text {
    fn line(&mut self, name: &str, value: impl std::fmt::Display) {
        // Writing to a string cannot fail.
        let value = value.to_string().replace(char::is_control, " ");
        let _ = writeln!(self.0, "{name:<14}{value}");
    }
}

fn pairs<T>(map: &BTreeMap<String, T>, value: impl Fn(&T) -> String) -> String {
    let pairs: Vec<String> =
        map.iter().map(|(name, entry)| format!("{name} {}", value(entry))).collect();
    pairs.join(", ")
}

/// Four significant digits, without an exponent where that is short.
fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if value.is_nan() {
        "none".to_owned()
    } else if value.is_infinite() {
        value.to_string()
    } else if (1e-3..1e6).contains(&magnitude) {
        let decimals = (3.0 - magnitude.log10().floor()).max(0.0) as usize;
        let text = format!("{value:.decimals$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    } else {
        format!("{value:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 1.0, -0.0625, 1234.56, 123_456.0, 1e-4, 2.5e7, f64::NAN].map(number);
        let expected = ["0", "1", "-0.0625", "1235", "123456", "1.000e-4", "2.500e7", "none"];
        assert_eq!(texts, expected);
    }
}
