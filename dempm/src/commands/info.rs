//! `dempm info`: prints a summary of a trajectory file.

use std::fmt::Write;
use std::path::Path;

use files::print_result;

use super::start::start_profile;
use crate::fronts::mass_front;
use crate::trajectory::{Field, Result, Trajectory};

/// Prints a summary of the trajectory at `path`.
///
/// # Errors
/// If it cannot be read, or nobody takes the summary.
pub fn info(path: &Path) -> miette::Result<()> {
    print_result(format_args!("{}", summary(&Trajectory::open(path)?)?))?;
    Ok(())
}

/// The text of the summary; reads every frame once.
fn summary(trajectory: &Trajectory) -> Result<String> {
    let header = trajectory.header();
    let mut text = Text::default();
    text.line("file", trajectory.path().display());
    text.line("scene", format_args!("{} (seed {})", header.title, header.seed));
    text.line("status", trajectory.status());
    for warning in trajectory.warnings().unwrap_or_default() {
        text.line("warning", warning);
    }
    text.line("created", &header.created);
    text.line("made by", pairs(&header.versions, |version| version.clone()));
    text.line("device", format_args!("{}, precision {}", header.device, header.precision));
    text.line("material", &header.material);
    let mass: f64 = trajectory.points().mass.iter().sum();
    text.line(
        "points",
        format_args!(
            "{}, {} m apart, {} kg/m",
            trajectory.points().mass.len(),
            number(header.point_spacing),
            number(mass)
        ),
    );
    if let (Some(count), Some(every)) = (trajectory.grain_count(), trajectory.grain_interval()) {
        let size = trajectory.stored_grain_bytes() as f64 / 1e6;
        text.line("grains", format_args!("{count}, in every {}, {size:.2} MB", nth(every)));
    }
    text.line(
        "domain",
        format_args!(
            "{} m x {} m, grid cell {} m",
            number(header.domain[0]),
            number(header.domain[1]),
            number(header.grid_cell)
        ),
    );
    if !header.parameters.is_empty() {
        text.line("parameters", pairs(&header.parameters, |&value| number(value)));
    }
    text.line("frames", frames(trajectory));
    if let Some(last) = trajectory.frames().checked_sub(1) {
        // From the positions, as trajectories of other programs may lack these scalars.
        let position = trajectory.frame(last)?.position;
        // The edge of the outermost point, as in the summary of `dempm run`.
        let most = |axis: usize| {
            let finite = position.iter().map(|x| x[axis]).filter(|x| x.is_finite());
            finite.fold(f64::NAN, f64::max) + 0.5 * header.point_spacing
        };
        text.line("final front", format_args!("{} m", number(most(0))));
        // It, too, ends half a spacing ahead of its point.
        let front = mass_front(&position, &trajectory.points().mass) + 0.5 * header.point_spacing;
        text.line("front of 99 %", format_args!("{} m", number(front)));
        let connected =
            trajectory.budget().get("front_connected").and_then(|front| front.get(last));
        if let Some(&front) = connected {
            text.line("front of pile", format_args!("{} m", number(front)));
        }
        text.line("final height", format_args!("{} m", number(most(1))));
    }
    text.line("wall time", wall_time(trajectory));
    let bytes: u64 = raw_bytes(trajectory);
    let size = trajectory.file_size();
    text.line(
        "file size",
        format_args!("{:.2} MB for {:.2} MB of data", size as f64 / 1e6, bytes as f64 / 1e6),
    );
    text.0 += &start_profile(trajectory)?;
    ranges(trajectory, &mut text)?;
    Ok(text.0)
}

fn frames(trajectory: &Trajectory) -> String {
    let (header, time) = (trajectory.header(), trajectory.time());
    let span = match (time.first(), time.last()) {
        (Some(&first), Some(&last)) => format!(" from {} to {} s", number(first), number(last)),
        _ => String::new(),
    };
    format!(
        "{}{span}, one every {} s, time step {} s",
        time.len(),
        number(header.frame_interval),
        number(header.time_step)
    )
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
fn wall_time(trajectory: &Trajectory) -> String {
    let phases = trajectory.wall_time();
    if phases.is_empty() {
        return "not recorded".to_owned();
    }
    let total: f64 = phases.values().sum();
    let share = |seconds: &f64| format!("{seconds:.2} s ({:.0} %)", 100.0 * seconds / total);
    format!("{total:.2} s: {}", pairs(phases, share))
}

/// Smallest and largest value of every component of every field.
fn ranges(trajectory: &Trajectory, text: &mut Text) -> Result<()> {
    let _ =
        writeln!(text.0, "\n{:<24}{:>14}{:>14}  {:<5}{:>12}", "field", "min", "max", "", "size");
    for field in trajectory.fields() {
        let components = field.components();
        let mut bounds = vec![[f64::NAN; 2]; components.len()];
        let (mut broken, mut first) = (0, None);
        for index in 0..trajectory.frames() {
            let values = trajectory.field::<f64>(field, index..index + 1)?;
            for (place, &value) in values.iter().flatten().enumerate() {
                let [low, high] = &mut bounds[place % components.len()];
                *low = low.min(value);
                *high = high.max(value);
                // Where a point deforms without pressure its inertial number is infinite.
                if value.is_nan() || value.is_infinite() && field != Field::InertialNumber {
                    broken += 1;
                    first.get_or_insert((index, place / components.len()));
                }
            }
        }
        let megabytes = trajectory.stored_bytes(field) as f64 / 1e6;
        for (index, (component, [low, high])) in std::iter::zip(components, bounds).enumerate() {
            let name = format!("{} {component}", field.name());
            let size = if index == 0 { format!("{megabytes:.2} MB") } else { String::new() };
            let line = format!(
                "{name:<24}{:>14}{:>14}  {:<5}{size:>12}",
                number(low),
                number(high),
                field.unit()
            );
            let _ = writeln!(text.0, "{}", line.trim_end());
        }
        if let Some((frame, point)) = first {
            let _ = writeln!(
                text.0,
                "{:<24}{broken:>14} values are not finite, the first at frame {frame}, point {point}",
                ""
            );
        }
    }
    for (name, values) in trajectory.budget() {
        let bound = |pick: fn(f64, f64) -> f64| number(values.iter().copied().fold(f64::NAN, pick));
        let name = name.replace(char::is_control, " ");
        let _ = writeln!(text.0, "{name:<24}{:>14}{:>14}", bound(f64::min), bound(f64::max));
    }
    Ok(())
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

fn pairs<T>(map: &std::collections::BTreeMap<String, T>, value: impl Fn(&T) -> String) -> String {
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
