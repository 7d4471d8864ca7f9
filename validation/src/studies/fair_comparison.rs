//! Methods against each other at equal error and at equal time, and when a network pays back.

use crate::models::ModelCost;
use crate::studies::pareto::{as_accurate, as_fast, break_even, front};
use crate::studies::sweep::{Error, Family, MEASURES, Measured, Sweep};

/// A method against its rivals by one measure of error.
pub struct Comparison<'s> {
    /// The method.
    pub method: &'s Measured,
    /// Name of the measure.
    pub measure: &'static str,
    /// The cheapest rival as accurate, if any is.
    pub accurate: Option<&'s Measured>,
    /// Its time over the method's.
    pub speed_up: Option<f64>,
    /// The truth's time over the method's.
    pub over_truth: f64,
    /// The most accurate rival as fast, if any is.
    pub fast: Option<&'s Measured>,
    /// Its error over the method's.
    pub gain: Option<f64>,
    /// Whether the method is on the Pareto front by the first measure.
    pub on_front: bool,
}

/// The most accurate network, and the solver's cheapest setting that is as accurate.
pub struct Best<'s> {
    /// The network.
    pub network: &'s Measured,
    /// The setting, if any is as accurate.
    pub rival: Option<&'s Measured>,
    /// Number of runs after which its data and training have paid back.
    pub break_even: Option<f64>,
}

/// When a network pays back against some rivals.
pub struct PayBack<'s> {
    /// The network.
    pub network: &'s Measured,
    /// Time to compute its data and to train it, s.
    pub invested: f64,
    /// Which rivals, in words.
    pub against: &'static str,
    /// The cheapest of them as accurate, if any is.
    pub rival: Option<&'s Measured>,
    /// Number of runs after which it has paid back; `None` if never.
    pub runs: Option<f64>,
}

/// The default packings, each network and each setting of the mu(I) law against its rivals, by McGreivy
/// and Hakim's rules.
pub fn comparisons(sweep: &Sweep) -> Vec<Comparison<'_>> {
    let mut all = Vec::new();
    let costs: Vec<_> = sweep.measured.iter().map(|m| m.cost(MEASURES[0].value)).collect();
    let front = front(&costs, (MEASURES[0].value)(&sweep.floor));
    for (place, method) in sweep.measured.iter().enumerate() {
        // The first setting after the truth has the defaults.
        let is_default = place == 1;
        let is_compared = matches!(method.family, Family::Continuum | Family::Network);
        if !(is_compared || is_default) || method.error.is_none() {
            continue;
        }
        let rivals = rivals(sweep, method);
        for measure in &MEASURES {
            let floor = (measure.value)(&sweep.floor);
            let costs: Vec<_> = rivals.iter().map(|m| m.cost(measure.value)).collect();
            let cost = method.cost(measure.value);
            let accurate = as_accurate(cost, &costs, floor);
            let fast = as_fast(cost, &costs);
            all.push(Comparison {
                method,
                measure: measure.name,
                accurate: accurate.map(|k| rivals[k]),
                speed_up: accurate.map(|k| costs[k].seconds / cost.seconds),
                over_truth: sweep.measured[0].seconds / cost.seconds,
                fast: fast.map(|k| rivals[k]),
                gain: fast.map(|k| costs[k].error.max(floor) / cost.error.max(floor)),
                on_front: front.contains(&place),
            });
        }
    }
    all
}

/// What a method is compared with: networks with all solvers, a solver with those of other kinds.
fn rivals<'s>(sweep: &'s Sweep, method: &Measured) -> Vec<&'s Measured> {
    let is_rival = |m: &&Measured| m.family.is_solver() && m.family != method.family;
    sweep.measured.iter().filter(is_rival).collect()
}

/// The most accurate network; `None` if no network was compared.
pub fn best_network(sweep: &Sweep) -> Option<Best<'_>> {
    let error = |m: &Measured| m.error.map_or(f64::NAN, |error| error.distance);
    let network = networks(sweep).min_by(|a, b| error(a).total_cmp(&error(b)))?;
    let rivals = rivals(sweep, network);
    let costs: Vec<_> = rivals.iter().map(|m| m.cost(distance)).collect();
    let found = as_accurate(network.cost(distance), &costs, sweep.floor.distance);
    let rival = found.map(|k| rivals[k]);
    let break_even = match (rival, model_cost(network)) {
        (Some(rival), Some(Ok(cost))) => break_even(cost.total(), network.seconds, rival.seconds),
        _ => None,
    };
    Some(Best { network, rival, break_even })
}

/// When networks pay back, against the whole solver and against packings. A network whose cost is
/// unknown is given with the reason.
pub fn pay_back(sweep: &Sweep) -> Vec<Result<[PayBack<'_>; 2], (&Measured, String)>> {
    let mut all = Vec::new();
    for network in networks(sweep) {
        let invested = match model_cost(network) {
            Some(Ok(cost)) => cost.total(),
            Some(Err(why)) => {
                all.push(Err((network, why)));
                continue;
            }
            None => continue,
        };
        let solvers = rivals(sweep, network);
        let packings: Vec<&Measured> =
            solvers.iter().copied().filter(|m| m.family == Family::Packings).collect();
        all.push(Ok([("all solvers", solvers), ("packings", packings)].map(
            |(against, rivals)| {
                let costs: Vec<_> = rivals.iter().map(|m| m.cost(distance)).collect();
                let found = as_accurate(network.cost(distance), &costs, sweep.floor.distance);
                let runs =
                    found.and_then(|k| break_even(invested, network.seconds, costs[k].seconds));
                let rival = found.map(|k| rivals[k]);
                PayBack { network, invested, against, rival, runs }
            },
        )));
    }
    all
}

fn networks(sweep: &Sweep) -> impl Iterator<Item = &Measured> {
    sweep.measured.iter().filter(|m| m.family == Family::Network && m.error.is_some())
}

fn distance(error: &Error) -> f64 {
    error.distance
}

fn model_cost(network: &Measured) -> Option<Result<ModelCost, String>> {
    network.model.as_ref().map(|model| ModelCost::beside(&model.path))
}
