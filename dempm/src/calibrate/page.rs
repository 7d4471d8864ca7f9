//! The page of a calibration: curves and bands over the data, parameters, and how they depend on each other.

use std::fmt::Write as _;

use plot::{Axis, Chart, Mark, PlotError, Series, dark_style, inlined, number};

use super::law::Law;
use super::parameter::{Free, Prior};
use super::posterior::Posterior;
use super::study::Study;
use super::targets::Targets;

/// Size of the charts of curves, and of those of the corner plot (pixels).
const LARGE: [u32; 2] = [560, 340];
const SMALL: [u32; 2] = [300, 240];
/// Most samples drawn of a pair of parameters.
const DRAWN: usize = 300;
/// Bars of the distribution of a parameter.
const BARS: usize = 24;

/// The page as HTML, complete in itself.
///
/// # Errors
/// If a chart cannot be drawn.
pub fn page(
    targets: &Targets,
    study: &Study,
    posterior: &Posterior,
    law: Option<&Law>,
) -> Result<String, PlotError> {
    let title = if targets.title.is_empty() { "Calibration" } else { &targets.title };
    let title = escaped(title);
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<title>{title}</title>\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<style>\n\
         body {{ font: 16px/1.5 sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; \
         color: #1c1c1a; background: #fdfdfb; }}\n\
         table {{ border-collapse: collapse; }} td, th {{ padding: 0.2rem 0.8rem; text-align: left; \
         border-bottom: 1px solid #dcdbd4; }}\n\
         figure {{ margin: 0; }} svg {{ max-width: 100%; height: auto; }}\n\
         .charts {{ display: flex; flex-wrap: wrap; gap: 1rem; }}\n\
         .corner {{ display: grid; gap: 0.25rem; overflow-x: auto; }}\n\
         @media (prefers-color-scheme: dark) {{ body {{ color: #e8e6e0; background: #1b1b1a; }} \
         td, th {{ border-color: #3d3c38; }} }}\n{}</style></head>\n<body>\n<h1>{title}</h1>\n",
        dark_style()
    );
    parameters(&mut html, targets, study, posterior);
    curves(&mut html, targets, posterior)?;
    if let Some(law) = law {
        friction(&mut html, law)?;
    }
    corner(&mut html, targets, posterior)?;
    html += "</body></html>\n";
    Ok(html)
}

fn parameters(html: &mut String, targets: &Targets, study: &Study, posterior: &Posterior) {
    *html += "<h2>Parameters</h2>\n<table><tr><th>parameter</th><th>mean</th>\
              <th>standard deviation</th><th>95 %</th><th>range</th><th>unit</th></tr>\n";
    for (k, free) in targets.free.iter().enumerate() {
        let [low, high] = posterior.interval[k].map(number);
        let [least, most] = free.range.map(number);
        // Writing to a string cannot fail.
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{low} to {high}</td><td>{least} to {most}</td><td>{}</td></tr>",
            free.key,
            number(posterior.mean[k]),
            number(posterior.sd[k]),
            free.unit(),
        );
    }
    *html += "</table>\n<ul>\n";
    for line in posterior.identifiability(targets) {
        let _ = writeln!(html, "<li>{}</li>", escaped(&line));
    }
    *html += "</ul>\n";
    let sets: usize = study.rounds.iter().map(Vec::len).sum();
    let misfit = study.best().map_or_else(String::new, |best| {
        format!(
            " The best of them misses the data by {:.2} standard deviations (RMS).",
            best.misfit
        )
    });
    let _ = writeln!(
        html,
        "<p>{sets} sets of parameters, {} packings each.{misfit}</p>",
        targets.method.packings
    );
}

fn curves(html: &mut String, targets: &Targets, posterior: &Posterior) -> Result<(), PlotError> {
    *html += "<h2>Tests</h2>\n<div class=\"charts\">\n";
    let mut scalars = String::new();
    let mut predicted = posterior.predicted.as_slice();
    for observation in &targets.observations {
        let points = observation.curve.x.len();
        let Some(abscissa) = observation.abscissa else {
            let [mean, low, high] = predicted[0].map(number);
            let unit = observation.unit();
            let _ = writeln!(
                scalars,
                "<tr><td>{}</td><td>{} ± {} {unit}</td><td>{mean} {unit} ({low} to {high})</td></tr>",
                escaped(&observation.name),
                number(observation.curve.y[0][0]),
                number(observation.sd[0]),
            );
            predicted = &predicted[1..];
            continue;
        };
        for (ordinate, measured) in observation.ordinates.iter().zip(&observation.curve.y) {
            let (band, rest) = predicted.split_at(points);
            predicted = rest;
            let ((x_label, x_factor), (y_label, y_factor)) = (abscissa.axis(), ordinate.axis());
            let point = |(x, y): (&f64, f64)| (x_factor * x, y_factor * y);
            let x = &observation.curve.x;
            let line = |k: usize| x.iter().zip(band.iter().map(move |b| b[k])).map(point);
            let chart = Chart {
                x: Axis::linear(x_label),
                y: Axis::linear(y_label),
                series: vec![
                    Series::new("95 %", Mark::Band, line(1).chain(line(2).rev()).collect()),
                    Series::new("posterior mean", Mark::Line, line(0).collect()),
                    Series::new(
                        "measured",
                        Mark::Circles,
                        x.iter().zip(measured.iter().copied()).map(point).collect(),
                    ),
                ],
                floor: None,
            };
            figure(html, &observation.name, &chart)?;
        }
    }
    *html += "</div>\n";
    if !scalars.is_empty() {
        let _ = writeln!(
            html,
            "<table><tr><th>test</th><th>measured</th><th>posterior (95 %)</th></tr>\n{scalars}</table>"
        );
    }
    Ok(())
}

/// Friction over the inertial number, with the fitted law.
fn friction(html: &mut String, law: &Law) -> Result<(), PlotError> {
    let measured = law.points.iter().map(|&[inertial, friction, _]| (inertial, friction));
    let fitted = (0..=60).map(|k| {
        let inertial = 1.0e-3 * 10.0_f64.powf(2.7 * f64::from(k) / 60.0);
        (inertial, law.parameters.friction(inertial))
    });
    let chart = Chart {
        x: Axis::log("inertial number"),
        y: Axis::linear("sin phi"),
        series: vec![
            Series::new("mu(I)", Mark::Line, fitted.collect()),
            Series::new("packings", Mark::Circles, measured.collect()),
        ],
        floor: None,
    };
    *html += "<h2>The mu(I) law of these grains</h2>\n<div class=\"charts\">\n";
    figure(html, "friction over the inertial number", &chart)?;
    *html += "</div>\n";
    Ok(())
}

/// Samples of every pair of parameters below the distribution of each.
fn corner(html: &mut String, targets: &Targets, posterior: &Posterior) -> Result<(), PlotError> {
    let columns = targets.free.len();
    let _ = writeln!(
        html,
        "<h2>Posterior</h2>\n<div class=\"corner\" style=\"grid-template-columns: \
         repeat({columns}, minmax(13rem, 1fr))\">"
    );
    let every = posterior.samples.len().div_ceil(DRAWN);
    for (i, free) in targets.free.iter().enumerate() {
        for (j, other) in targets.free.iter().enumerate().take(i + 1) {
            let (title, y, series) = if i == j {
                let outline = histogram(posterior, i, is_log(free));
                (free.key.clone(), Axis::linear("share"), Series::new("", Mark::Line, outline))
            } else {
                let samples = posterior.samples.iter().step_by(every).map(|s| (s[j], s[i]));
                let title = format!("{} and {}", other.key, free.key);
                (title, axis(free), Series::new("", Mark::Dots, samples.collect()))
            };
            let chart = Chart { x: axis(other), y, series: vec![series], floor: None };
            let svg = inlined(&chart.svg_of_size(SMALL)?, &title);
            let (row, column) = (i + 1, j + 1);
            let _ = writeln!(html, "<figure style=\"grid-area: {row} / {column}\">{svg}</figure>");
        }
    }
    *html += "</div>\n";
    Ok(())
}

fn is_log(free: &Free) -> bool {
    free.prior == Prior::LogUniform
}

fn axis(free: &Free) -> Axis {
    let unit = free.unit();
    let label = if unit.is_empty() { free.key.clone() } else { format!("{} [{unit}]", free.key) };
    Axis { label, log: is_log(free) }
}

/// Outline of the bars of a parameter's distribution, as wide as each other on its axis.
fn histogram(posterior: &Posterior, parameter: usize, log: bool) -> Vec<(f64, f64)> {
    let on_axis = |value: f64| if log { value.ln() } else { value };
    let values = || posterior.samples.iter().map(|sample| on_axis(sample[parameter]));
    let (low, high) = (values().fold(f64::MAX, f64::min), values().fold(f64::MIN, f64::max));
    let width = ((high - low) / BARS as f64).max(f64::MIN_POSITIVE);
    let mut share = [0.0; BARS];
    for value in values() {
        let bar = ((value - low) / width) as usize;
        share[bar.min(BARS - 1)] += 1.0 / posterior.samples.len() as f64;
    }
    let mut outline = vec![(low, 0.0)];
    for (bar, &share) in share.iter().enumerate() {
        let left = low + bar as f64 * width;
        outline.extend([(left, share), (left + width, share)]);
    }
    outline.push((high, 0.0));
    outline.into_iter().map(|(x, y)| (if log { x.exp() } else { x }, y)).collect()
}

fn figure(html: &mut String, title: &str, chart: &Chart) -> Result<(), PlotError> {
    let title = escaped(title);
    let svg = inlined(&chart.svg_of_size(LARGE)?, &title);
    let _ = writeln!(html, "<figure><figcaption>{title}</figcaption>{svg}</figure>");
    Ok(())
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
