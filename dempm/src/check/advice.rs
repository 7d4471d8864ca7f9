//! Cheaper settings and their measured errors.

/// `tables/what-a-scene-needs--recommendations.csv` of `validation report`, settings of the solver only:
/// the quick suite on two cores (processor seconds) and the full suite on a GPU.
const MEASURED: &str = include_str!("recommendations.csv");

/// The cheapest setting within a tolerance of a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Advice {
    /// The reference, with scene and device.
    pub reference: &'static str,
    /// The compared quantity: `shape` or `every point`.
    pub goal: &'static str,
    /// Tolerance relative to the runout.
    pub tolerance: &'static str,
    /// Measured error relative to the runout.
    pub error: &'static str,
    /// The setting.
    pub setting: &'static str,
    /// Time of the reference over time of the setting.
    pub speed_up: f64,
}

/// All recommendations; lines in another format are left out.
pub(super) fn measured() -> Vec<Advice> {
    MEASURED.lines().skip(1).filter_map(parse).collect()
}

impl Advice {
    /// Whether the setting is cheaper than packings of `discs` discs.
    pub fn is_cheaper_than(&self, discs: usize) -> bool {
        let Some((own, more)) = self.setting.split_once(" discs") else { return true };
        own.parse::<usize>().is_ok_and(|own| own < discs || (own == discs && !more.is_empty()))
    }
}

fn parse(line: &'static str) -> Option<Advice> {
    let cells: Vec<&str> = line.split(',').collect();
    let &[reference, goal, tolerance, setting, error, seconds, slowest] = &cells[..] else {
        return None;
    };
    let [seconds, slowest]: [f64; 2] = [seconds.parse().ok()?, slowest.parse().ok()?];
    Some(Advice { reference, goal, tolerance, error, setting, speed_up: slowest / seconds })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_report_is_understood() {
        let lines = MEASURED.lines().count() - 1;
        assert!(lines > 0);
        assert_eq!(measured().len(), lines);
        assert!(measured().iter().all(|advice| advice.speed_up > 0.0));
    }

    #[test]
    fn what_a_scene_has_already_is_no_advice() {
        let advice = parse("column,shape,5 %,200 discs,3.7 %,64,129").unwrap();
        assert!(advice.is_cheaper_than(400) && !advice.is_cheaper_than(200));
        let longer = parse("column,shape,5 %,200 discs + long substeps,3.7 %,64,129").unwrap();
        assert!(longer.is_cheaper_than(200) && !longer.is_cheaper_than(100));
        let law = parse("column,shape,5 %,mu(I) + cells of 0.25 m,3.7 %,1,129").unwrap();
        assert!(law.is_cheaper_than(10));
    }
}
