//! What cheaper settings cost in accuracy, as it was measured.

/// What `tables/what-a-scene-needs--recommendations.csv` of `validation report` says of settings of the
/// solver, with the packings of the reference and the device beside the name of the scene: the quick suite on two
/// cores (processor seconds), the full one on a GPU (`docs/report`).
const MEASURED: &str = include_str!("recommendations.csv");

/// The cheapest setting within a tolerance of a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Advice {
    /// The reference, and what it was compared on.
    pub reference: &'static str,
    /// What was to be right.
    pub goal: &'static str,
    /// Tolerance and measured error, parts of the runout.
    pub tolerance: &'static str,
    pub error: &'static str,
    pub setting: &'static str,
    /// Time of the reference over time of the setting.
    pub speed_up: f64,
}

/// All advice; lines that are not as the report writes them are left out.
pub(super) fn measured() -> Vec<Advice> {
    MEASURED.lines().skip(1).filter_map(parse).collect()
}

impl Advice {
    /// Whether it has fewer discs than so many, or something else that is cheaper.
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
