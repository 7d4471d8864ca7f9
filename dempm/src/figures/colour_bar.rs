//! The colour bar below the panels of a figure.

use plot::{Anchor, ColourScale, INK, Pen, PenError, Range, tick_texts, ticks};

use super::layout::Layout;

/// Draws the colour bar below the panels: colours, ticks, label, a note if the range is cut, and what `grey` points
/// are if there are any.
pub(super) fn draw_colour_bar(
    pen: &Pen<'_, '_>,
    layout: &Layout,
    scale: &ColourScale,
    name: &str,
    unit: &str,
    grey: Option<&str>,
) -> Result<(), PenError> {
    let (font, thin) = (layout.font, 0.06 * layout.font);
    let range = scale.range;
    let (left, top) = (layout.left, layout.bar_top);
    let (right, bottom) = (left + layout.bar_width, layout.bar_top + 1.1 * font);
    let steps = layout.bar_width.ceil() as usize;
    for step in 0..steps {
        let part = [step, step + 1].map(|s| s as f64 / steps as f64);
        let x = part.map(|part| left + part * layout.bar_width);
        let colour = scale.at(0.5 * (part[0] + part[1]));
        pen.rectangle([[x[0], top], [x[1], bottom]], colour)?;
    }
    // Arrowheads where values go on beyond the colours.
    let (middle, tip) = (0.5 * (top + bottom), 0.8 * font);
    let mut outline = vec![[left, top], [right, top]];
    if range.cut[1] {
        let corners = [[right, top], [right + tip, middle], [right, bottom]];
        pen.polygon(&corners, scale.at(1.0))?;
        outline.push([right + tip, middle]);
    }
    outline.extend([[right, bottom], [left, bottom]]);
    if range.cut[0] {
        let corners = [[left, top], [left - tip, middle], [left, bottom]];
        pen.polygon(&corners, scale.at(0.0))?;
        outline.push([left - tip, middle]);
    }
    outline.push([left, top]);
    pen.line(&outline, thin, INK)?;

    // Thousands of pascals are easier to read as kilopascals.
    let kilo = unit == "Pa" && !scale.log && range.low.abs().max(range.high) >= 2000.0;
    let factor = if kilo { 1e-3 } else { 1.0 };
    for (fraction, text) in bar_ticks(layout, scale, factor) {
        let x = left + fraction * layout.bar_width;
        pen.line(&[[x, bottom], [x, bottom + 0.3 * font]], thin, INK)?;
        pen.text(&text, [x, bottom + 0.45 * font], 0.9 * font, Anchor::Below)?;
    }
    let label = match (unit, kilo) {
        ("", _) => name.to_owned(),
        (_, true) => format!("{name} (k{unit})"),
        (_, false) => format!("{name} ({unit})"),
    };
    let x = right + 2.2 * font;
    pen.text(&label, [x, middle], font, Anchor::Left)?;
    let mut y = middle;
    let small = 0.75 * font;
    let note = match range.cut {
        [false, false] => None,
        [true, true] => Some("colours from the 1st to the 99th percentile"),
        [true, false] => Some("colours begin at the 1st percentile"),
        [false, true] => Some("colours end at the 99th percentile"),
    };
    if let Some(note) = note {
        y += 1.25 * font;
        pen.text(note, [x, y], small, Anchor::Left)?;
    }
    if let Some(grey) = grey {
        y += 1.15 * font;
        pen.disc([x + 0.4 * font, y], 0.35 * font, ColourScale::UNKNOWN)?;
        pen.text(grey, [x + 1.1 * font, y], small, Anchor::Left)?;
    }
    Ok(())
}

/// Ticks of the colour bar: where they are, from 0 to 1, and their text.
fn bar_ticks(layout: &Layout, scale: &ColourScale, factor: f64) -> Vec<(f64, String)> {
    let Range { low, high, .. } = scale.range;
    let wanted = (layout.bar_width / (4.5 * layout.font)).min(8.0);
    if let Some(classes) = scale.classes {
        let every = (classes as f64 / wanted).ceil().max(1.0) as usize;
        let at = |class: usize| (scale.range.fraction(class as f64), class.to_string());
        return (0..classes).step_by(every).map(at).collect();
    }
    if scale.log {
        return log_ticks(low, high, wanted)
            .into_iter()
            .map(|(logarithm, text)| (scale.range.fraction(logarithm), text))
            .collect();
    }
    let ticks = ticks(factor * low, factor * high, wanted);
    let texts = tick_texts(&ticks);
    let at = |tick: &f64| scale.range.fraction(tick / factor);
    std::iter::zip(ticks.iter().map(at), texts).collect()
}

/// Powers of ten between two logarithms; over less than two decades, round multiples of them.
fn log_ticks(low: f64, high: f64, wanted: f64) -> Vec<(f64, String)> {
    let decades = high.floor() - low.ceil();
    if decades >= 2.0 {
        let step = (decades / wanted).ceil().max(1.0) as usize;
        let (first, last) = (low.ceil() as i32, high.floor() as i32);
        return (first..=last)
            .step_by(step)
            .map(|power| (f64::from(power), format!("10{}", superscript(power))))
            .collect();
    }
    let mut marks = Vec::new();
    for power in low.floor() as i32..=high.ceil() as i32 {
        for digit in [1.0_f64, 2.0, 5.0] {
            let logarithm = f64::from(power) + digit.log10();
            if (low..=high).contains(&logarithm) {
                let text = match power {
                    -3..=5 => (digit * 10_f64.powi(power)).to_string(),
                    _ => format!("{digit}·10{}", superscript(power)),
                };
                marks.push((logarithm, text));
            }
        }
    }
    marks
}

fn superscript(number: i32) -> String {
    let raised = |digit: char| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => {
            char::from_u32(u32::from(digit) - u32::from('0') + u32::from('⁰')).unwrap_or(digit)
        }
    };
    number.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_of_logarithms() {
        let texts = |low, high| -> Vec<String> {
            log_ticks(low, high, 6.0).into_iter().map(|(_, text)| text).collect()
        };
        assert_eq!(texts(-3.2, 0.1), ["10⁻³", "10⁻²", "10⁻¹", "10⁰"]);
        assert_eq!(texts(-1.1, 0.1), ["0.1", "0.2", "0.5", "1"]);
    }
}
