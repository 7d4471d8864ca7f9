//! Points or discs at one moment, as SVG.

use std::fmt::Write as _;

use crate::render::figure::{self, Figure};
use crate::studies::stability::Picture;
use crate::text::number;

/// Longer side of the picture (px).
const SIDE: f64 = 640.0;
/// Height of the colour scale below it (px).
const SCALE: f64 = 48.0;
/// Colours from the smallest to the largest value (viridis).
const COLOURS: [&str; 8] =
    ["#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39", "#fde725"];

/// A picture of a study, with a caption that names what the colours show.
pub fn figure(picture: &Picture) -> Figure {
    let grey = if picture.reference.is_empty() { "" } else { "; grey: the direct solver" };
    let caption = format!("Colour: {}{grey}.", picture.colour);
    Figure::new(&picture.title, figure::Picture::Svg(draw(picture)), caption)
}

fn draw(picture: &Picture) -> String {
    let [left, bottom, right, top] = picture.window;
    let scale = SIDE / (right - left).max(top - bottom);
    let [width, height] = [(right - left) * scale, (top - bottom) * scale];
    let place = |x: [f64; 2]| [(x[0] - left) * scale, (top - x[1]) * scale];
    let finite = || picture.value.iter().copied().filter(|v| v.is_finite());
    let low = finite().fold(f64::MAX, f64::min);
    let high = finite().fold(f64::MIN, f64::max).max(low + f64::MIN_POSITIVE);

    let mut svg = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0} {:.0}\" \
         font-family=\"sans-serif\" font-size=\"14\"><rect width=\"{width:.0}\" \
         height=\"{height:.0}\" fill=\"none\" stroke=\"#6B6B66\"/>",
        width.max(280.0),
        height + SCALE
    );
    let radius = |k: usize| {
        let own = picture.radius.get(k).or(picture.radius.first()).copied();
        (own.unwrap_or_default() * scale).max(1.5)
    };
    let reference: Vec<[f64; 2]> = picture.reference.iter().map(|&x| place(x)).collect();
    dots(&mut svg, &reference, radius(0), "#BDBCB4");
    for (colour, name) in COLOURS.iter().enumerate() {
        let shown = |value: &f64| {
            let share = (value - low) / (high - low);
            // Casting saturates, and a value that is no number becomes 0.
            ((share * 7.0).round() as usize).min(7) == colour
        };
        let values = picture.value.iter().take(picture.position.len()).enumerate();
        let chosen = values.filter(|(_, value)| shown(value)).map(|(k, _)| k);
        if picture.radius.len() > 1 {
            for k in chosen {
                disc(&mut svg, place(picture.position[k]), radius(k), name);
            }
        } else {
            let places: Vec<[f64; 2]> = chosen.map(|k| place(picture.position[k])).collect();
            dots(&mut svg, &places, radius(0), name);
        }
    }
    for &[x0, y0, x1, y1] in &picture.boxes {
        let [x, y] = place([x0, y1]);
        let _ = write!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"#6B6B66\"/>",
            (x1 - x0) * scale,
            (y1 - y0) * scale
        );
    }
    for (k, colour) in COLOURS.iter().enumerate() {
        let x = 80 + 15 * k;
        let y = height + 14.0;
        let _ = write!(
            svg,
            "<rect x=\"{x}\" y=\"{y:.0}\" width=\"15\" height=\"14\" fill=\"{colour}\"/>"
        );
    }
    let y = height + 26.0;
    let _ = write!(
        svg,
        "<text x=\"74\" y=\"{y:.0}\" text-anchor=\"end\" fill=\"#6B6B66\">{}</text>\
         <text x=\"206\" y=\"{y:.0}\" fill=\"#6B6B66\">{}</text></svg>",
        number(low),
        number(high)
    );
    svg
}

/// A disc with a thin edge.
fn disc(svg: &mut String, [x, y]: [f64; 2], radius: f64, colour: &str) {
    if x.is_finite() && y.is_finite() {
        let _ = write!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"{colour}\" \
             stroke=\"#FFFFFF\" stroke-width=\"0.5\"/>"
        );
    }
}

/// Many discs of one size and colour as one path, lines of no length with round ends: a little
/// smaller, so that neighbours stay apart.
fn dots(svg: &mut String, places: &[[f64; 2]], radius: f64, colour: &str) {
    let mut path = String::new();
    for [x, y] in places.iter().filter(|x| x.iter().all(|x| x.is_finite())) {
        let _ = write!(path, "M{x:.1} {y:.1}h0");
    }
    if !path.is_empty() {
        let _ = write!(
            svg,
            "<path d=\"{path}\" stroke=\"{colour}\" stroke-width=\"{:.1}\" \
             stroke-linecap=\"round\" fill=\"none\"/>",
            1.8 * radius
        );
    }
}
