//! Error over wall time for all methods and settings on one scene.

use crate::block::{Block, Figure, Table};
use crate::chart::{Axis, Chart, Mark, Series};
use crate::context::Context;
use crate::model_cost::ModelCost;
use crate::pareto::{as_accurate, as_fast, break_even, front};
use crate::section::Section;
use crate::sweep::{Case, Error, Family, Measure, Measured, Sweep};
use crate::table::{number, seconds};

/// The chart of one scene.
pub struct SpeedAccuracy {
    /// Place of its case in [`Case::of`].
    pub case: usize,
    pub title: &'static str,
}

/// Measures of error: name, unit, value.
const MEASURES: [(&str, &str, Measure); 3] = [
    ("MSE of points", "box²", |error| error.mse),
    ("front", "m", |error| error.front),
    ("height profile", "m", |error| error.height),
];

impl Section for SpeedAccuracy {
    fn title(&self) -> &'static str {
        self.title
    }

    fn estimate(&self, context: &Context) -> f64 {
        Case::of(context.suite).get(self.case).map_or(0.0, |case| case.estimate(context))
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let cases = Case::of(context.suite);
        let Some(case) = cases.get(self.case) else {
            return Ok(vec![Block::missing(
                "The chart",
                "this scene is computed with the full suite only.",
                "`--suite full` does it, on a GPU.",
            )]);
        };
        let sweep = case.measure(context)?;
        let mut blocks = vec![Block::text(format!(
            "Scene: {}. The reference ({}) ran with two seeds; errors are means of those \
                 against each, and what lies below the difference between the two (the shade) \
                 cannot be told from it. All other runs have a third seed. Time is wall time of the \
                 computation on {}, one run at a time, packings prepared and files not counted; \
                 for a network it includes the frames that it starts from.",
            case.description,
            case.reference_name(),
            context.device_name
        ))];
        for (name, unit, measure) in MEASURES {
            let picture = chart(&sweep, name, unit, measure).draw()?;
            blocks.push(Block::Figure(Figure::new(
                format!("Error of the {name} over time"),
                picture,
                "Down and left is better. The line joins what nothing beats in both; numbers are \
                 those of the table.",
            )));
        }
        blocks.push(Block::Table(all(&sweep)));
        blocks.extend(failures(&sweep));
        blocks.push(Block::heading("At equal error, at equal time"));
        blocks.extend(comparisons(&sweep));
        blocks.extend(pay_back(context, &sweep));
        blocks.push(Block::missing("Networks in bf16", "`surrogate` computes in f32 only.", ""));
        if context.models.is_empty() {
            blocks.push(no_model());
        }
        Ok(blocks)
    }
}

/// What to say where a model would be needed.
pub fn no_model() -> Block {
    Block::missing(
        "Learned simulators",
        "no model was found.",
        "`surrogate train` makes one (docs/surrogate.md); `--models` takes the folder that it is in.",
    )
}

fn chart(sweep: &Sweep, name: &str, unit: &str, measure: Measure) -> Chart {
    let of_family = |(family, title, mark): (Family, &str, Mark)| {
        let places = sweep.measured.iter().enumerate().filter(|(_, m)| m.family == family);
        let (labels, points) = places
            .map(|(place, m)| {
                let cost = m.cost(measure);
                ((place + 1).to_string(), (cost.seconds, cost.error))
            })
            .unzip();
        Series { labels, ..Series::new(title, mark, points) }
    };
    let mut series: Vec<Series> = FAMILIES.map(of_family).to_vec();
    series.retain(|series| !series.points.is_empty());
    let costs: Vec<_> = sweep.measured.iter().map(|m| m.cost(measure)).collect();
    let floor = measure(&sweep.floor);
    let best = front(&costs, floor).into_iter().map(|k| (costs[k].seconds, costs[k].error));
    series.push(Series::new("Pareto front", Mark::Reference, best.collect()));
    Chart {
        x: Axis::log("wall time [s]"),
        y: Axis::log(format!("{name}, error [{unit}]")),
        series,
        floor: Some((floor, "within the noise of seeds".to_owned())),
    }
}

const FAMILIES: [(Family, &str, Mark); 3] = [
    (Family::Packings, "packings (direct solver)", Mark::Circles),
    (Family::Continuum, "mu(I) law", Mark::Squares),
    (Family::Network, "networks", Mark::Triangles),
];

fn all(sweep: &Sweep) -> Table {
    let columns = [
        "",
        "method",
        "wall time [s]",
        "MSE [box²]",
        "front [m]",
        "height profile [m]",
        "distance of points [m]",
    ];
    let mut table = Table::new("All settings", columns).note(format!(
        "MSE and distance: over all points and frames; front and height profile: at the end, where \
         the front of the reference is at {:.2} m. Where points differ in size, the finer ones are \
         averaged over the squares of the coarser ones.",
        sweep.front
    ));
    for (place, m) in sweep.measured.iter().enumerate() {
        let error = |measure: fn(&Error) -> f64| {
            m.error.as_ref().map_or(String::new(), |e| number(measure(e)))
        };
        table.row([
            (place + 1).to_string(),
            m.name.clone(),
            if m.error.is_some() { number(m.seconds) } else { "failed".to_owned() },
            error(|e| e.mse),
            error(|e| e.front),
            error(|e| e.height),
            error(|e| e.distance),
        ]);
    }
    table
}

fn failures(sweep: &Sweep) -> Vec<Block> {
    let failed = sweep.measured.iter().filter(|m| m.error.is_none());
    failed
        .flat_map(|m| [Block::text(format!("{} failed:", m.name)), Block::Quote(m.failure.clone())])
        .collect()
}

/// Each network and each continuum setting against the solver, by McGreivy and Hakim's rules.
fn comparisons(sweep: &Sweep) -> Vec<Block> {
    let columns = [
        "method",
        "measure",
        "cheapest solver setting as accurate",
        "speed-up",
        "best solver setting as fast",
        "its error is larger by",
    ];
    let mut table = Table::new("Fair comparisons", columns).note(
        "Networks are compared with packings and the mu(I) law, the law with packings. Speed-up: \
         time of that setting over time of the method; below 1 the method loses. Errors within the \
         noise count as equal.",
    );
    let mut lines = Vec::new();
    for method in
        sweep.measured.iter().filter(|m| m.family != Family::Packings && m.error.is_some())
    {
        let rivals = rivals(sweep, method);
        for (name, _, measure) in MEASURES {
            let floor = measure(&sweep.floor);
            let costs: Vec<_> = rivals.iter().map(|m| m.cost(measure)).collect();
            let cost = method.cost(measure);
            let accurate = as_accurate(cost, &costs, floor);
            let fast = as_fast(cost, &costs);
            let speed_up = accurate.map(|k| costs[k].seconds / cost.seconds);
            let gain = fast.map(|k| costs[k].error.max(floor) / cost.error.max(floor));
            table.row([
                method.name.clone(),
                name.to_owned(),
                accurate.map_or("none measured".to_owned(), |k| rivals[k].name.clone()),
                speed_up.map_or(String::new(), number),
                fast.map_or("none is as fast".to_owned(), |k| rivals[k].name.clone()),
                gain.map_or(String::new(), number),
            ]);
            if name == MEASURES[0].0 {
                lines.push(sentence(method, speed_up, accurate.map(|k| rivals[k]), gain));
            }
        }
    }
    if table.rows.is_empty() {
        return Vec::new();
    }
    vec![Block::List(lines), Block::Table(table)]
}

/// What a method is measured against: everything of the families that solve equations.
fn rivals<'s>(sweep: &'s Sweep, method: &Measured) -> Vec<&'s Measured> {
    let fair = |family| match method.family {
        Family::Network => family != Family::Network,
        _ => family == Family::Packings,
    };
    sweep.measured.iter().filter(|m| fair(m.family)).collect()
}

fn sentence(
    method: &Measured,
    speed_up: Option<f64>,
    rival: Option<&Measured>,
    gain: Option<f64>,
) -> String {
    let name = &method.name;
    let equal_error = match (speed_up, rival) {
        (Some(ratio), Some(rival)) if ratio >= 1.0 => format!(
            "{} times as fast as the cheapest setting of the solver that is as accurate ({})",
            number(ratio),
            rival.name
        ),
        (Some(ratio), Some(rival)) => format!(
            "{} times slower than {}, which is as accurate: it loses",
            number(1.0 / ratio),
            rival.name
        ),
        _ => "more accurate than every setting of the solver that was measured".to_owned(),
    };
    let equal_time = match gain {
        Some(gain) if gain > 1.0 => {
            format!("in its time the solver's best setting has {} times its error", number(gain))
        }
        Some(gain) if gain < 1.0 => format!(
            "in its time the solver can be more accurate ({} of its error): it loses",
            number(gain)
        ),
        Some(_) => "in its time the solver is as accurate".to_owned(),
        None => "no setting of the solver is as fast".to_owned(),
    };
    format!("{name} (points): {equal_error}; {equal_time}.")
}

/// After how many runs a network has paid for its data and its training.
fn pay_back(context: &Context, sweep: &Sweep) -> Vec<Block> {
    let networks =
        sweep.measured.iter().filter(|m| m.family == Family::Network && m.error.is_some());
    let columns = [
        "network",
        "data and training",
        "a run",
        "cheapest solver setting as accurate",
        "a run of it",
        "pays back after",
    ];
    let mut table = Table::new("Break-even", columns).note(
        "Number of runs of this scene after which making data and training have paid back, \
               against the cheapest setting of the solver whose points are as accurate.",
    );
    let mut blocks = vec![Block::heading("When a network pays back")];
    for network in networks {
        let model = context.models.iter().find(|model| model.name == network.name);
        let cost = match model.map(|model| ModelCost::beside(&model.path)) {
            Some(Ok(cost)) => cost,
            Some(Err(missing)) => {
                blocks.push(Block::missing(
                    format!("When `{}` pays back", network.name),
                    missing.why,
                    missing.remedy,
                ));
                continue;
            }
            None => continue,
        };
        let rivals = rivals(sweep, network);
        let costs: Vec<_> = rivals.iter().map(|m| m.cost(|e| e.mse)).collect();
        let found = as_accurate(network.cost(|e| e.mse), &costs, sweep.floor.mse);
        let runs = found.and_then(|k| break_even(cost.total(), network.seconds, costs[k].seconds));
        table.row([
            network.name.clone(),
            seconds(cost.total()),
            seconds(network.seconds),
            found.map_or("none measured".to_owned(), |k| rivals[k].name.clone()),
            found.map_or(String::new(), |k| seconds(costs[k].seconds)),
            runs.map_or("never".to_owned(), |runs| format!("{runs:.0} runs")),
        ]);
    }
    if !table.rows.is_empty() {
        blocks.push(Block::Table(table));
    }
    if blocks.len() > 1 { blocks } else { Vec::new() }
}
