//! Error over wall time for all methods and settings on one scene.

use plot::{Axis, Chart, Mark, Series};

use super::cover::stands_for_all;
use super::fair_comparison::{comparison_blocks, headline, lead, pay_back_blocks};
use super::no_model::{left_out, no_model};
use crate::context::Context;
use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::fair_comparison::best_network;
use crate::studies::pareto::front;
use crate::studies::sweep::{Case, Error, Family, MEASURES, Measure, Measured, Sweep};
use crate::text::number;

/// The charts of one scene.
pub struct SpeedAccuracy {
    /// Name of its scene.
    pub scene: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// Its lead.
    pub lead: &'static str,
}

/// Load average per core above which wall times are doubtful: one program, and a little.
const BUSY: f64 = 1.3;

/// Width and height of the chart of the first screen, pixels.
const COVER: [u32; 2] = [460, 330];

/// The series of a chart, and their names and marks.
const FAMILIES: [(Family, &str, Mark); 6] = [
    (Family::Discs, "discs: the truth", Mark::Squares),
    (Family::CoarserDiscs, "larger discs", Mark::Squares),
    (Family::Packings, "packings", Mark::Circles),
    (Family::Continuum, "mu(I) law", Mark::Triangles),
    (Family::Network, "networks", Mark::Crosses),
    (Family::Ablation, "networks of the ablation", Mark::Crosses),
];

impl Section for SpeedAccuracy {
    fn title(&self) -> &'static str {
        self.title
    }

    fn lead(&self) -> &'static str {
        self.lead
    }

    fn estimate(&self, context: &Context) -> f64 {
        let case = case(context, self.scene);
        case.map_or(0.0, |case| case.estimate(context))
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let Some(case) = case(context, self.scene) else {
            return Ok(vec![Block::missing(
                "The chart",
                "only the full suite computes this scene.",
                "`--suite full` computes it, on a GPU.",
            )]);
        };
        let sweep = case.measure_speed(context)?;
        let mut blocks = Vec::new();
        if stands_for_all(case.scene, context.suite) {
            blocks.push(Block::lead("Speed", lead(&case, &sweep)));
            blocks.push(Block::Figure(cover_chart(&case, &sweep)?.on_cover()));
        }
        blocks.push(Block::headline(headline(case.scene.name, &sweep)));
        blocks.push(description(&case, &sweep, &context.device_name));
        blocks.extend(busy(&sweep));
        blocks.extend(elsewhere(&sweep));
        blocks.extend(left_out(&sweep));
        for measure in &MEASURES {
            blocks.push(Block::Figure(figure(&case, &sweep, measure)?));
        }
        blocks.push(Block::Table(settings(&sweep)));
        blocks.extend(failures(&sweep));
        blocks.push(Block::heading("At equal error, at equal time"));
        blocks.extend(comparison_blocks(&sweep));
        blocks.extend(pay_back_blocks(&sweep));
        if context.models.is_empty() {
            blocks.push(no_model());
        } else if context.device == "cpu" {
            blocks.push(Block::missing(
                "Networks in bf16",
                "bf16 needs a GPU.",
                "`--device cuda` uses one.",
            ));
        }
        Ok(blocks)
    }
}

/// The case of a scene, if the suite has it.
fn case(context: &Context, scene: &str) -> Option<Case> {
    Case::of_speed(context.suite).into_iter().find(|case| case.scene.name == scene)
}

fn description(case: &Case, sweep: &Sweep, device: &str) -> Block {
    Block::text(format!(
        "Scene: {} (`scenes/truth/`). Errors are distances from the discs, of which {} seeds ran; errors \
         below the spread between two seeds (shaded) are equally good. Settings change what their names \
         say in the defaults of the packings, or of the mu(I) law. Time is wall time of the computation on \
         {device}, one run at a time, without preparing packings, columns of discs and kernels, copying \
         them to the device and writing files, but with the frames that a network starts from. Times with \
         a spread in the table are medians of three; all others were measured once.",
        case.scene.description, sweep.seeds
    ))
}

/// A warning where other programs ran, so that wall times are doubtful.
fn busy(sweep: &Sweep) -> Option<Block> {
    let load = sweep.measured.iter().filter_map(|m| m.load).fold(0.0, f64::max);
    (load > BUSY).then(|| {
        Block::text(format!(
            "Other programs were running: up to {} processes shared each core. Wall times are longer \
             than they would be alone, by different factors; processor times can be compared.",
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
            "Not on {device} as all others, so that times cannot be compared: {}.",
            others.join("; ")
        ))
    })
}

/// All settings by one measure of error, numbered as in the table.
fn figure(case: &Case, sweep: &Sweep, measure: &Measure) -> miette::Result<Figure> {
    let costs: Vec<_> = sweep.measured.iter().map(|m| m.cost(measure.value)).collect();
    let floor = (measure.value)(&sweep.floor);
    let best = front(&costs, floor);
    let mut series = families(sweep, measure.value, |place, m| {
        // The ablation's networks lie close together.
        if m.family == Family::Ablation { String::new() } else { (place + 1).to_string() }
    });
    let line = best.iter().map(|&k| (costs[k].seconds, costs[k].error)).collect();
    series.push(Series::new("Pareto front", Mark::Reference, line));
    let svg = Chart {
        x: Axis::log("wall time [s]"),
        y: Axis::log(format!("{} [{}]", measure.name, measure.unit)),
        series,
        floor: Some((floor, "within the spread between seeds of the discs".to_owned())),
    }
    .svg()?;
    let best: Vec<String> =
        best.iter().map(|&k| format!("{} {}", k + 1, sweep.measured[k].name)).collect();
    let caption = format!(
        "{}, against {} seeds of the discs. Down and left is better. The line joins the settings that no other beats in both: {}. The \
         other numbers are in the table \"All settings\".",
        case.scene.name,
        sweep.seeds,
        best.join("; ")
    );
    Ok(Figure::new(format!("Error over wall time: {}", measure.name), Picture::Svg(svg), caption))
}

/// Points by family, with labels by index and setting; families without points are left out.
fn families(
    sweep: &Sweep,
    measure: fn(&Error) -> f64,
    label: impl Fn(usize, &Measured) -> String,
) -> Vec<Series> {
    let of_family = |(family, title, mark): (Family, &str, Mark)| {
        let settings = sweep.measured.iter().enumerate().filter(|(_, m)| m.family == family);
        let (labels, points) = settings
            .map(|(place, m)| {
                let cost = m.cost(measure);
                (label(place, m), (cost.seconds, cost.error))
            })
            .unzip();
        Series { labels, ..Series::new(title, mark, points) }
    };
    let all = FAMILIES.map(of_family).into_iter();
    all.filter(|series: &Series| !series.points.is_empty()).collect()
}

/// The chart of the first screen: metres over seconds, with labels instead of a legend.
fn cover_chart(case: &Case, sweep: &Sweep) -> miette::Result<Figure> {
    let network = best_network(sweep).map(|best| best.network.name.clone());
    let continuum = cheapest(sweep, Family::Continuum);
    let label = |place: usize, m: &Measured| {
        let name = Some(m.name.as_str());
        let text = match place {
            0 => "every grain",
            1 => "packings in points",
            _ if name == network.as_deref() => "best network",
            _ if name == continuum => "a formula",
            _ => "",
        };
        text.to_owned()
    };
    let mut series = families(sweep, |error| error.distance, label);
    series.iter_mut().for_each(|series| series.name.clear());
    let floor = (sweep.floor.distance, "two runs with other grains differ by this".to_owned());
    let svg = Chart {
        x: Axis::log("computing time [s]"),
        y: Axis::log("distance of points [m]"),
        series,
        floor: Some(floor),
    }
    .svg_of_size(COVER)?;
    let caption = format!(
        "{}: each mark is a setting of a model, by the root mean square distance of its points from the same \
         scene with every grain as a disc. Squares: discs; circles: packings; triangles: a formula; crosses: \
         networks. Down and left is better.",
        case.scene.name
    );
    Ok(Figure::new("How fast, and how far off", Picture::Svg(svg), caption))
}

/// Name of the fastest setting of a family.
fn cheapest(sweep: &Sweep, family: Family) -> Option<&str> {
    let done = sweep.measured.iter().filter(|m| m.family == family && m.error.is_some());
    done.min_by(|a, b| a.seconds.total_cmp(&b.seconds)).map(|m| m.name.as_str())
}

fn settings(sweep: &Sweep) -> Table {
    let columns = [
        "",
        "method",
        "wall time [s]",
        "spread [s]",
        "on",
        "processor time [s]",
        "distance [m]",
        "front [m]",
        "mass misplaced",
    ];
    let mut table = Table::new("All settings", columns).note(format!(
        "Spread: between the shortest and the longest of three times. Processor time: of the whole \
         program, over all threads. Errors against the discs: distance, root mean square over points and \
         frames; front and mass misplaced, at the end, where the front of the discs is at {:.2} m. Where \
         points differ in size, the finer ones are averaged over the squares of the coarser ones.",
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
            error(|e| e.distance),
            error(|e| e.front),
            error(|e| e.misplaced),
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
