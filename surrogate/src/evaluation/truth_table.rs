//! Distances from the truth by class as a table and as CSV.

use std::fmt::Write as _;

use files::csv_cell;

use super::truth::{AgainstTruth, TruthRow};

/// Times of the table, s; and the end.
const TIMES: [f64; 5] = [0.2, 0.5, 1.0, 1.5, 2.0];
/// Largest ratio that counts as equal to the truth, and as near to it.
const RATIOS: [f64; 2] = [1.5, 2.0];

/// All scenes and times as CSV: lengths in metres; `others` names the other runs.
pub fn truth_csv(scenes: &[AgainstTruth], others: &[String]) -> String {
    let mut text = "class,scene,seeds,time,spread,distance,ratio".to_owned();
    others.iter().for_each(|name| text += &format!(",{}", csv_cell(name)));
    text.push('\n');
    for scene in scenes {
        for row in &scene.rows {
            let number = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:.6e}"));
            let ratio = row.distance.map(|distance| scene.ratio(distance, row.spread));
            let [class, name] = [&scene.class, &scene.scene].map(|text| csv_cell(text));
            // Writing to a string cannot fail.
            let _ = write!(text, "{class},{name},{},{:.6},", scene.seeds, row.time);
            let cells =
                [Some(row.spread), row.distance, ratio].into_iter().chain(row.others.clone());
            text += &cells.map(number).collect::<Vec<_>>().join(",");
            text.push('\n');
        }
    }
    text
}

/// A table for the terminal: for each class and time root mean squares over the scenes, and how many scenes are
/// within some multiples of the spread at every time.
pub fn truth_report(scenes: &[AgainstTruth], others: &[String]) -> String {
    let mut text =
        "Distances from the mean of the other seeds in metres, root mean squares over the points \
                    and scenes.\n\n"
            .to_owned();
    let mut head = vec!["class", "time [s]", "one seed", "network"];
    head.extend(others.iter().map(String::as_str));
    let width = head[3..].iter().map(|name| name.len()).max().unwrap_or(0).max(9);
    let mut line = |cells: &[String]| {
        let mut one = format!("{:<16}{:>9}{:>10}", cells[0], cells[1], cells[2]);
        cells[3..].iter().for_each(|cell| one += &format!("  {cell:>width$}"));
        text += one.trim_end();
        text.push('\n');
    };
    line(&head.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
    let mut classes: Vec<&str> = Vec::new();
    for scene in scenes {
        if !classes.contains(&scene.class.as_str()) {
            classes.push(&scene.class);
        }
    }
    for class in &classes {
        let of_class: Vec<&AgainstTruth> =
            scenes.iter().filter(|scene| scene.class == *class).collect();
        let end = of_class.iter().filter_map(|scene| scene.rows.last()).map(|row| row.time);
        let end = end.fold(0.0, f64::max);
        for time in TIMES.into_iter().filter(|time| *time < end).chain([end]) {
            let rows: Vec<&TruthRow> = of_class.iter().filter_map(|scene| scene.at(time)).collect();
            let cell = |of: &dyn Fn(&TruthRow) -> Option<f64>| root_mean_square(&rows, of);
            let mut cells = vec![
                (*class).to_owned(),
                format!("{time:.2}"),
                cell(&|row| Some(row.spread)),
                cell(&|row| row.distance),
            ];
            cells.extend((0..others.len()).map(|k| cell(&|row| row.others[k])));
            line(&cells);
        }
    }
    text.push('\n');
    for class in classes {
        let of_class: Vec<&AgainstTruth> =
            scenes.iter().filter(|scene| scene.class == class).collect();
        text += &within(class, "network", &of_class, |scene| Some(scene.worst()));
        for (k, name) in others.iter().enumerate() {
            text += &within(class, name, &of_class, |scene| scene.worst_of(k));
        }
    }
    text
}

/// The root mean square over the scenes that have a value, as a cell; a star if not all do.
fn root_mean_square(rows: &[&TruthRow], of: &dyn Fn(&TruthRow) -> Option<f64>) -> String {
    let values: Vec<f64> = rows.iter().filter_map(|row| of(row)).collect();
    if values.is_empty() {
        return "-".to_owned();
    }
    let mean = values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64;
    format!("{:.4}{}", mean.sqrt(), if values.len() < rows.len() { "*" } else { "" })
}

/// How many scenes of a class are within multiples of the spread at every time, and the worst.
fn within(
    class: &str,
    name: &str,
    scenes: &[&AgainstTruth],
    worst: impl Fn(&AgainstTruth) -> Option<f64>,
) -> String {
    let found: Vec<(f64, &str)> =
        scenes.iter().filter_map(|scene| Some((worst(scene)?, scene.scene.as_str()))).collect();
    let Some(&(ratio, scene)) = found.iter().max_by(|a, b| a.0.total_cmp(&b.0)) else {
        return String::new();
    };
    let share = |most: f64| {
        let count = found.iter().filter(|(ratio, _)| *ratio <= most).count();
        format!("{count} of {} within {most} times the spread", found.len())
    };
    let failed = if ratio.is_finite() { format!("{ratio:.1} times") } else { "failed".to_owned() };
    format!("{class}, {name}: {}; worst {failed} ({scene})\n", RATIOS.map(share).join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(name: &str, distance: Option<f64>, other: Option<f64>) -> AgainstTruth {
        let row = |time| TruthRow { time, spread: 0.1, distance, others: vec![other] };
        AgainstTruth {
            scene: format!("heap-{name}"),
            class: "heap".to_owned(),
            seeds: 4,
            spacing: 0.0625,
            rows: vec![row(0.5), row(1.0)],
            failure: None,
        }
    }

    /// Distances of 0.1 and 0.7 m are 0.5 m in the root mean square.
    #[test]
    fn classes_are_summed_up() {
        let scenes = [scene("0", Some(0.1), Some(0.3)), scene("1", Some(0.7), None)];
        let others = ["rve".to_owned()];
        let report = truth_report(&scenes, &others);
        assert!(
            report.contains("heap                 1.00    0.1000     0.5000    0.3000*"),
            "{report}"
        );
        let expected = "heap, network: 1 of 2 within 1.5 times the spread, 1 of 2 within 2 times the \
                        spread; worst 7.0 times (heap-1)";
        assert!(report.contains(expected), "{report}");
        assert!(report.contains("heap, rve: 0 of 1 within 1.5"), "{report}");
        let csv = truth_csv(&scenes, &others);
        assert_eq!(csv.lines().count(), 5);
        assert!(csv.ends_with("1.000000,1.000000e-1,7.000000e-1,7.000000e0,\n"), "{csv}");
    }
}
