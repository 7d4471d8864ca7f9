//! The files of a calibration.

use std::fmt::Write as _;

use dem::Grains;

use super::law::Law;
use super::posterior::{Determined, Posterior};
use super::study::Study;
use super::targets::Targets;

/// Keys of `[grains]` that are no properties of a material.
const NUMERICS: [&str; 6] =
    ["local_damping", "mass_scale", "step_factor", "skin", "overlap_warning", "overlap_limit"];

/// Grains, ready to use in a scene, with the free parameters of a posterior; with a law, the continuum too.
///
/// # Errors
/// If parameters cannot be written as TOML.
pub fn calibrated_toml(
    targets: &Targets,
    posterior: Option<&Posterior>,
    law: Option<&Law>,
) -> Result<String, toml::ser::Error> {
    let mut text = format!("# {}\n", title(targets));
    let [mean, sd] =
        posterior.map_or([&[][..]; 2], |found| [found.mean.as_slice(), found.sd.as_slice()]);
    for ((free, mean), sd) in targets.free.iter().zip(mean).zip(sd) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "# {} = {:.4e}, standard deviation {:.1e}", free.key, mean, sd);
    }
    let mut grains = toml::Table::try_from(targets.rve_with(mean).grains)?;
    let usual = toml::Table::try_from(Grains::default())?;
    // Scenes have defaults of their own for these.
    grains.retain(|key, value| !NUMERICS.contains(&key) || usual.get(key) != Some(&*value));
    text += &format!("\n[grains]\n{}", toml::to_string(&grains)?);
    if let Some(law) = law {
        text += "\n# Packings in steady shear: inertial number, sin phi, standard deviation between packings\n";
        for [inertial, friction, sd] in &law.points {
            let _ = writeln!(text, "# {inertial:.2e} {friction:.3} {sd:.3}");
        }
        text += &format!("[mu-i]\n{}", toml::to_string(&law.parameters)?);
    }
    Ok(text)
}

/// Posterior mean, standard deviation, interval and correlations, and what is determined.
///
/// # Errors
/// If it cannot be written as TOML.
pub fn summary_toml(
    targets: &Targets,
    study: &Study,
    posterior: &Posterior,
) -> Result<String, toml::ser::Error> {
    use toml::{Table, Value};
    let number = |x: f64| Value::Float(x);
    let mut summary = Table::new();
    summary.insert("title".into(), Value::String(title(targets)));
    if let Some(best) = study.best() {
        summary.insert("best_misfit".into(), number(best.misfit));
    }
    let words = posterior.identifiability(targets).into_iter().map(Value::String);
    summary.insert("identifiability".into(), Value::Array(words.collect()));
    let mut parameters = Table::new();
    for (k, free) in targets.free.iter().enumerate() {
        let mut one = Table::new();
        one.insert("mean".into(), number(posterior.mean[k]));
        one.insert("sd".into(), number(posterior.sd[k]));
        one.insert("interval".into(), Value::Array(posterior.interval[k].map(number).to_vec()));
        let determined = match posterior.determined[k] {
            Determined::Well => "well",
            Determined::Weakly => "weakly",
            Determined::Not => "not",
        };
        one.insert("determined".into(), Value::String(determined.into()));
        let mut correlation = Table::new();
        for (j, other) in targets.free.iter().enumerate().filter(|(j, _)| *j != k) {
            correlation.insert(other.key.clone(), number(posterior.correlation[(k, j)]));
        }
        if !correlation.is_empty() {
            one.insert("correlation".into(), Value::Table(correlation));
        }
        parameters.insert(free.key.clone(), Value::Table(one));
    }
    summary.insert("parameter".into(), Value::Table(parameters));
    toml::to_string(&summary)
}

/// The log: every set of parameters that was simulated, with its misfit.
pub fn members_csv(targets: &Targets, study: &Study) -> String {
    let keys: Vec<&str> = targets.free.iter().map(|free| free.key.as_str()).collect();
    let mut text = format!("round,member,{},misfit\n", keys.join(","));
    for (round, members) in study.rounds.iter().enumerate() {
        for (k, member) in members.iter().enumerate() {
            let values: Vec<String> =
                targets.values(&member.u).iter().map(|x| format!("{x:.6e}")).collect();
            let _ = writeln!(text, "{round},{k},{},{:.4}", values.join(","), member.misfit);
        }
    }
    text
}

fn title(targets: &Targets) -> String {
    let title = targets.title.replace(['\n', '\r'], " ");
    if title.is_empty() { "Calibrated grains".into() } else { title }
}
