//! All chapters, in the order of the page.

use super::column_collapse::ColumnCollapse;
use super::column_rollouts::ColumnRollouts;
use super::element_tests::ElementTests;
use super::model_choice::ModelChoice;
use super::recommendations::Recommendations;
use super::runs::Runs;
use super::speed_accuracy::SpeedAccuracy;
use super::yade::Yade;
use super::{against_truth, paper, stability};
use crate::render::section::Chapter;

/// All chapters.
pub fn all() -> Vec<Chapter> {
    vec![
        Chapter {
            title: "Against the truth",
            about: "The truth of a scene is the same scene with every grain as a disc. Two such runs whose \
                    grains differ at random (seeds) drift apart, so no model can be held to less than the \
                    spread between them. Models: packings, a material point method (MPM) whose points carry \
                    the material through a grid, with the stress of a packing of discs in each point; the \
                    mu(I) law, a formula for flowing grains in place of the packings; discs 2 and 4 times as \
                    large; networks that learnt from packings or from discs.",
            sections: against_truth::all(),
        },
        Chapter {
            title: "The paper, side by side",
            about: "The direct solver is the MPM with a packing of discs (an RVE) in every point. A network \
                    predicts the next frame from the last few; a rollout is its prediction frame after frame \
                    from its own output. These sections repeat the tables and figures of Zhao, Chen \
                    and Zhao (2025), whose Baseline is a graph network (TGNNS). ColAxB is a column A m \
                    wide and B m high that collapses in a box 10 m wide or wider, Case 1 to 5 are \
                    blocks of 3 m that stand, fall or are thrown; MSE is the mean square distance of points from \
                    the solver's run, not from the discs, with the width of the box as unit: in a box of 10 m, 1e-4 is \
                    0.1 m.",
            sections: paper::all(),
        },
        Chapter {
            title: "Speed against accuracy",
            about: "Every setting of the packings, the mu(I) law, larger discs and every network run the \
                    same scene. Errors are distances from the discs; those below the spread between \
                    seeds of the discs are equally good. Substeps are steps of the packings within a \
                    step of the MPM; mirror means that each prediction is averaged with that of the \
                    mirror image.",
            sections: vec![
                Box::new(SpeedAccuracy {
                    scene: "Small column",
                    title: "Speed: small column",
                    lead: "A column 0.5 m wide and 0.5 m high: error and wall time of all settings.",
                }),
                Box::new(SpeedAccuracy {
                    scene: "Column a = 1",
                    title: "Speed: column of 1 m",
                    lead: "A column 1 m wide and 1 m high: error and wall time of all settings.",
                }),
                Box::new(SpeedAccuracy {
                    scene: "Col2x2",
                    title: "Speed: Col2x2",
                    lead: "A column 2 m wide and 2 m high: error and wall time of all settings.",
                }),
                Box::new(SpeedAccuracy {
                    scene: "Col3x3",
                    title: "Speed: Col3x3",
                    lead: "A column 3 m wide and 3 m high: error and wall time of a few settings.",
                }),
            ],
        },
        Chapter {
            title: "Learned models against what they learnt from",
            about: "A network reproduces the model that it learnt from, packings or discs, with its errors. These \
                    sections measure networks against that model.",
            sections: vec![Box::new(ColumnRollouts)],
        },
        Chapter {
            title: "What a scene needs",
            about: "Which model is enough for which accuracy: chosen beforehand, and from measurements of the scene itself.",
            sections: vec![Box::new(ModelChoice), Box::new(Recommendations)],
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
            title: "Experiments, theory, another code",
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
