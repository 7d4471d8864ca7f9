//! All chapters, in the order of the page.

use super::column_collapse::ColumnCollapse;
use super::column_rollouts::ColumnRollouts;
use super::element_tests::ElementTests;
use super::recommendations::Recommendations;
use super::runs::Runs;
use super::speed_accuracy::SpeedAccuracy;
use super::yade::Yade;
use super::{paper, stability};
use crate::render::section::Chapter;

/// All chapters.
pub fn all() -> Vec<Chapter> {
    vec![
        Chapter {
            title: "The paper, side by side",
            about: "The direct solver is a material point method (MPM): points carry the material \
                    through a grid, and the stress of each point comes from a packing of discs inside \
                    it (an RVE) or from the mu(I) law, a formula for flowing grains. A network predicts \
                    the next frame from the last few; a rollout is its prediction frame after frame \
                    from its own output. These sections repeat the tables and figures of Zhao, Chen \
                    and Zhao (2025), whose Baseline is a graph network (TGNNS). ColAxB is a column A m \
                    wide and B m high that collapses in a box 10 m wide or wider, Case 1 to 5 are \
                    blocks of 3 m that stand, fall or are thrown; MSE is the mean square distance of points from the truth, \
                    the solver's run, with the width of the box as unit: in a box of 10 m, 1e-4 is \
                    0.1 m.",
            sections: paper::all(),
        },
        Chapter {
            title: "Speed against accuracy",
            about: "Every setting of the solver and every network runs the same scene. The reference \
                    is the finest setting; two runs of it with different random packings (seeds) show \
                    the noise, below which no error means anything. The front is the foremost point of \
                    the deposit; substeps are steps of the packings within a step of the MPM; mirror \
                    means that each prediction is averaged with that of the mirror image.",
            sections: vec![
                Box::new(SpeedAccuracy {
                    case: 0,
                    title: "Column of 1 m",
                    lead: "A column 1 m wide and 1 m high: error and wall time of all settings.",
                }),
                Box::new(SpeedAccuracy {
                    case: 1,
                    title: "Col2x2",
                    lead: "A column 2 m wide and 2 m high: error and wall time of most settings.",
                }),
                Box::new(SpeedAccuracy {
                    case: 2,
                    title: "Col5x3",
                    lead: "A column 5 m wide and 3 m high: error and wall time of a few settings.",
                }),
                Box::new(ColumnRollouts),
            ],
        },
        Chapter {
            title: "What a scene needs",
            about: "From the same measurements: which setting is enough for which accuracy.",
            sections: vec![Box::new(Recommendations)],
        },
        Chapter {
            title: "Stability",
            about: "Each method is pushed until it fails. A run is stable, warned (correct, with a \
                    warning), failed (wrong, with a warning or an error) or failed silently (wrong \
                    without a word, which is a defect). A threshold is the value of a parameter at \
                    which the outcome changes.",
            sections: stability::all(),
        },
        Chapter {
            title: "External truth",
            about: "The solver against experiments, theory and another code.",
            sections: vec![Box::new(ColumnCollapse), Box::new(ElementTests), Box::new(Yade)],
        },
        Chapter {
            title: "How it was made",
            about: "Every run behind the numbers, and the programs that made them.",
            sections: vec![Box::new(Runs)],
        },
    ]
}

/// The lead of a section, by its title; empty if there is no such section.
pub fn section_lead(title: &str) -> String {
    let sections = all().into_iter().flat_map(|chapter| chapter.sections);
    let lead = sections.filter(|section| section.title() == title).map(|section| section.lead());
    lead.collect()
}

/// The introduction of a chapter, by its title; empty if there is no such chapter.
pub fn chapter_about(title: &str) -> String {
    let chapters = all().into_iter().filter(|chapter| chapter.title == title);
    chapters.map(|chapter| chapter.about).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::text::slug;

    #[test]
    fn no_two_sections_have_the_same_name() {
        let chapters = all();
        let titles: Vec<String> =
            chapters.iter().flat_map(|c| &c.sections).map(|s| slug(s.title())).collect();
        let distinct: HashSet<&String> = titles.iter().collect();
        assert_eq!(distinct.len(), titles.len(), "{titles:?}");
    }

    #[test]
    fn every_section_has_a_lead() {
        for chapter in all() {
            assert!(!chapter.about.is_empty());
            for section in &chapter.sections {
                assert!(section.lead().ends_with('.'), "{}", section.title());
            }
        }
    }
}
