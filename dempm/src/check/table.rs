//! [`Needs`] as an aligned table.

use std::fmt;

use super::accuracy::Accuracy;
use super::needs::{COLLISIONAL, Needs};
use super::units::{bytes, duration, grouped, quantity};

/// A line of the table: quantity, value and note.
struct Row(&'static str, String, String);

impl Needs {
    fn sections(&self) -> Vec<(String, Vec<Row>)> {
        let percent = |part: f64| format!("{:.0} % of the limit", 100.0 * part);
        let mut size = vec![
            Row(
                "material points",
                grouped(self.points as f64),
                format!("{} apart", quantity(self.spacing, "m")),
            ),
            Row(
                "background grid",
                format!("{} x {}", self.cells[0], self.cells[1]),
                format!("cells of {}", quantity(self.cell, "m")),
            ),
        ];
        let mut steps = vec![Row(
            "macro step",
            quantity(self.step, "s"),
            match &self.rve {
                None if self.dem.is_some() => "discs take shorter ones".to_owned(),
                _ => format!(
                    "{} {}",
                    percent(self.step / self.step_limit),
                    quantity(self.step_limit, "s")
                ),
            },
        )];
        let mut state = vec![
            Row("bulk density", format!("{:.0} kg/m³", self.density), String::new()),
            Row(
                "wave speed",
                format!("{:.0} m/s", self.wave_speed),
                "stiffest response of the material".into(),
            ),
            Row(
                "pressure at the base",
                quantity(self.base_pressure, "Pa"),
                format!("under {}", quantity(self.height, "m")),
            ),
        ];
        let mut cost = Vec::new();
        if let Some(dem) = &self.dem {
            let note = match &self.rve {
                Some(rve) => format!(
                    "{} in each RVE, {} different packing{}",
                    rve.discs,
                    rve.packings,
                    if rve.packings == 1 { "" } else { "s" }
                ),
                None => {
                    format!("about {:.0} in the square of a point", dem.discs / self.points as f64)
                }
            };
            size.push(Row("discs", grouped(dem.discs.round()), note));
            steps.push(Row(
                "DEM step",
                quantity(dem.step, "s"),
                format!(
                    "{} {}, {} in a macro step",
                    percent(dem.step / dem.step_limit),
                    quantity(dem.step_limit, "s"),
                    dem.substeps
                ),
            ));
            if dem.stiffness_number.is_finite() {
                state.push(Row(
                    "stiffness number there",
                    format!("{:.0}", dem.stiffness_number),
                    format!("overlaps about {:.2} % of a diameter", 100.0 / dem.stiffness_number),
                ));
            }
            cost.push(Row(
                "disc-steps",
                format!("{:.2e}", dem.disc_steps),
                format!("{:.2e} a second, measured now", dem.rate),
            ));
        }
        if let Some(rve) = &self.rve {
            size.push(Row(
                "side of an RVE",
                quantity(rve.side, "m"),
                format!(
                    "{:.2} cells: a sample of the material, not a region of the domain",
                    rve.side / self.cell
                ),
            ));
        }
        state.push(Row(
            "peak velocity",
            format!("{:.1} m/s", self.peak_velocity),
            "upper bound: free fall from the top".into(),
        ));
        if let Some(i) = self.inertial_number {
            let regime = match i {
                i if i < 1.0e-3 => "quasi-static",
                i if i < COLLISIONAL => "dense flow",
                _ => "collisional",
            };
            state.push(Row("inertial number", format!("{i:.1e}"), regime.into()));
        }
        if let Some(time) = self.collapse_time {
            state.push(Row("time of a collapse", quantity(time, "s"), "3.2 sqrt(H / g)".into()));
        }
        if let Some([left, right]) = self.reach {
            state.push(Row(
                "reach of the material",
                format!("{left:.1} to {right:.1} m"),
                "columns of discs without walls".into(),
            ));
        }
        steps.push(Row(
            "steps",
            grouped(self.steps as f64),
            quantity(self.steps as f64 * self.step, "s"),
        ));
        steps.push(Row(
            "frames",
            grouped(self.frames as f64),
            format!("one every {} steps, and the start", self.steps / self.frames.max(1)),
        ));
        cost.push(Row("memory", bytes(self.memory), "points and discs".into()));
        cost.push(Row("trajectory", bytes(self.output), "before compression".into()));
        cost.push(Row("time", duration(self.seconds), "estimate".into()));
        if self.preparation > 0.0 {
            let note = "before, unless the cache has it".into();
            cost.push(Row("preparation", duration(self.preparation), note));
        }
        let sections = [("Size", size), ("Steps", steps), ("State", state), ("Cost", cost)];
        let mut sections = Vec::from(sections.map(|(heading, rows)| (heading.to_owned(), rows)));
        sections.extend(self.accuracy.as_ref().map(expected));
        sections
    }
}

/// The expected distance from the truth, and what it rests on.
fn expected(accuracy: &Accuracy) -> (String, Vec<Row>) {
    let Accuracy { distance, spread, scene, cell, height, preliminary, beyond } = accuracy;
    let measured = if *preliminary { "preliminary, from" } else { "from" };
    let from = format!(
        "{measured} {scene} ({} high, cells of {})",
        quantity(*height, "m"),
        quantity(*cell, "m")
    );
    let points =
        |metres: &f64| Row("points, root mean square", quantity(*metres, "m"), from.clone());
    let mut rows: Vec<Row> = distance.iter().map(points).collect();
    let note = if distance.is_some() { "the scatter of the truth".into() } else { from.clone() };
    rows.push(Row("two seeds of discs", quantity(*spread, "m"), note));
    if !beyond.is_empty() {
        rows.push(Row("outside of what was measured", String::new(), beyond.join(", ")));
    }
    ("Expected distance from the same scene as discs, at the end".to_owned(), rows)
}

impl fmt::Display for Needs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}, material {})", self.title, self.name, self.material)?;
        let sections = self.sections();
        let rows = || sections.iter().flat_map(|(_, rows)| rows);
        let width = |text: &str| text.chars().count();
        let labels = rows().map(|row| width(row.0)).max().unwrap_or(0);
        let values = rows().map(|row| width(&row.1)).max().unwrap_or(0);
        for (heading, rows) in &sections {
            write!(f, "\n\n{heading}")?;
            for Row(label, value, note) in rows {
                let line = format!("  {label:labels$}  {value:>values$}  {note}");
                write!(f, "\n{}", line.trim_end())?;
            }
        }
        if self.warnings.is_empty() && self.scene_warnings.is_empty() {
            return write!(f, "\n\nNothing to warn about.");
        }
        if !self.warnings.is_empty() {
            write!(f, "\n\nWarnings")?;
        }
        for warning in &self.warnings {
            write!(f, "\n  - {warning}")?;
        }
        Ok(())
    }
}
