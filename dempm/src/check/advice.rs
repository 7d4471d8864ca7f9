//! What cheaper settings cost in accuracy, as it was measured.

/// What `tables/what-a-scene-needs--recommendations.csv` of `validation report` says of settings of the
/// solver, with the device and the packings of the reference in the name of the scene: the quick suite on two
/// cores (processor seconds), the full one on a GPU (`docs/report`).
const MEASURED: &str = include_str!("recommendations.csv");

/// The cheapest setting within a tolerance on one scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Advice {
    pub scene: &'static str,
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
    /// Whether it is another setting than packings of so many discs, or fewer of them.
    pub fn is_cheaper_than(&self, discs: usize) -> bool {
        let own = self.setting.strip_suffix(" discs").and_then(|own| own.parse::<usize>().ok());
        own.is_none_or(|own| own < discs)
    }
}

fn parse(line: &'static str) -> Option<Advice> {
    let cells: Vec<&str> = line.split(',').collect();
    let &[scene, goal, tolerance, setting, error, seconds, reference] = &cells[..] else {
        return None;
    };
    let [seconds, reference]: [f64; 2] = [seconds.parse().ok()?, reference.parse().ok()?];
    Some(Advice { scene, goal, tolerance, error, setting, speed_up: reference / seconds })
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
        let law = parse("column,shape,5 %,mu(I) + cells of 0.25 m,3.7 %,1,129").unwrap();
        assert!(law.is_cheaper_than(10));
    }
}
