//! Error over wall time for all methods and settings on one scene.

mod comparisons;

use self::comparisons::{comparisons, headline, pay_back};
use plot::{Axis, Chart, Mark, Series};

use crate::block::{Block, Figure, Table};
use crate::context::Context;
use crate::pareto::front;
use crate::section::Section;
use crate::sweep::{Case, Error, Family, Measure, Sweep};
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
        // The middle one stands for all.
        let cover = self.case == cases.len() / 2;
        let [one, other] = sweep.reference_seconds.map(seconds);
        let mut blocks = vec![
            if cover {
                Block::lead("Speed", headline(case.name, &sweep))
            } else {
                Block::headline(headline(case.name, &sweep))
            },
            Block::text(format!(
                "Scene: {}. The reference ({}) ran with two seeds; errors are means of those \
                 against each, and what lies below the difference between the two (the shade) \
                 cannot be told from it. All other runs have a third seed. The grid of the \
                 reference is that of the scene: settings with other cells show what that choice is \
                 worth. Time is wall time of the computation on {}, one run at a time: preparing \
                 packings and kernels, copying them to the device and writing files are not \
                 counted, the frames that a network starts from are. Where there is a spread in \
                 the table, the time is the median of three; all else was timed once, and the two \
                 references, equal but for their seeds, took {one} and {other}.",
                case.description, case.reference_words, context.device_name
            )),
        ];
        blocks.extend(busy(&sweep));
        blocks.extend(elsewhere(&sweep));
        for (place, (name, unit, measure)) in MEASURES.into_iter().enumerate() {
            let picture =
                chart(&sweep, name, unit, measure).svg().map(crate::figure::Picture::Svg)?;
            let title = format!("Error over wall time: {name}");
            let costs: Vec<_> = sweep.measured.iter().map(|m| m.cost(measure)).collect();
            let best = front(&costs, measure(&sweep.floor)).into_iter();
            let best: Vec<String> =
                best.map(|k| format!("{} {}", k + 1, sweep.measured[k].name)).collect();
            let caption = format!(
                "{}. Down and left is better. The line joins what nothing beats in both: {}. Other \
                 numbers are in the table \"All settings\".",
                case.name,
                best.join("; ")
            );
            let figure = Figure::new(title, picture, caption);
            let figure = if place == 0 && cover { figure.on_cover() } else { figure };
            blocks.push(Block::Figure(figure));
        }
        blocks.push(Block::Table(all(&sweep)));
        blocks.extend(failures(&sweep));
        blocks.push(Block::heading("At equal error, at equal time"));
        blocks.extend(comparisons(&sweep));
        blocks.extend(pay_back(&sweep));
        if context.models.is_empty() {
            blocks.push(no_model());
        } else if context.device == "cpu" {
            blocks.push(Block::missing(
                "Networks in bf16",
                "only a GPU computes in it.",
                "`--device cuda` uses one.",
            ));
        }
        Ok(blocks)
    }
}

/// A warning where wall times say little, since other programs were running.
fn busy(sweep: &Sweep) -> Option<Block> {
    let load = sweep.measured.iter().filter_map(|m| m.load).fold(0.0, f64::max);
    (load > BUSY).then(|| {
        Block::text(format!(
            "Other programs were running: up to {} processes wanted each core. Wall times are \
             longer than they would be alone, by different factors; processor times can be \
             compared.",
            number(load)
        ))
    })
}

/// A warning where a method did not run on the device of the others.
fn elsewhere(sweep: &Sweep) -> Option<Block> {
    let device = &sweep.measured[0].device;
    let others = sweep.measured.iter().filter(|m| m.error.is_some() && m.device != *device);
    let others: Vec<String> = others.map(|m| format!("{} (on {})", m.name, m.device)).collect();
    (!others.is_empty()).then(|| {
        Block::text(format!(
            "Not on {device} as all else, so that their times cannot be compared: {}.",
            others.join("; ")
        ))
    })
}

/// Processes per core above which wall times are doubtful: one program, and a little.
const BUSY: f64 = 1.3;

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
                // The ablation's networks lie close together.
                let numbered = family != Family::Ablation;
                let label = if numbered { (place + 1).to_string() } else { String::new() };
                (label, (cost.seconds, cost.error))
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

const FAMILIES: [(Family, &str, Mark); 4] = [
    (Family::Packings, "packings (direct solver)", Mark::Circles),
    (Family::Continuum, "mu(I) law", Mark::Squares),
    (Family::Network, "networks", Mark::Triangles),
    (Family::Ablation, "networks of the ablation", Mark::Crosses),
];

fn all(sweep: &Sweep) -> Table {
    let columns = [
        "",
        "method",
        "wall time [s]",
        "spread [s]",
        "on",
        "processor time [s]",
        "MSE [box²]",
        "front [m]",
        "height profile [m]",
        "points [m]",
    ];
    let mut table = Table::new("All settings", columns).note(format!(
        "Spread: between the shortest and the longest of three times. Processor time: of the whole \
         program, over all threads. MSE and points (its root, in \
         metres): over all points and frames; front and height profile: at the end, where the front \
         of the reference is at {:.2} m. Where points differ in size, the finer ones are \
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
            m.spread.map_or(String::new(), number),
            m.device.clone(),
            m.processor_seconds.map_or(String::new(), number),
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
