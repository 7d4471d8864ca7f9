//! The sections of the chapter, in the paper's order.

use super::ablation::Ablation;
use super::cases::Cases;
use super::data::Data;
use super::networks::Networks;
use super::resolutions::Resolutions;
use super::stated_accuracy::StatedAccuracy;
use super::training_curves::TrainingCurves;
use super::wall_times::WallTimes;
use crate::render::section::Section;

/// The sections of the chapter.
pub fn all() -> Vec<Box<dyn Section>> {
    vec![
        Box::new(StatedAccuracy),
        Box::new(Data),
        Box::new(Networks),
        Box::new(WallTimes),
        Box::new(TrainingCurves),
        Box::new(Cases {
            title: "Fig. 9 and 10: validation cases",
            lead: "Five blocks of 3 m that stand, fall or are thrown, as the networks predict them.",
            set: "valid",
            only: |_| true,
            cover: "",
        }),
        Box::new(Ablation),
        Box::new(Resolutions),
        Box::new(Cases {
            title: "Fig. 17 to 21: test set",
            lead: "Columns of other sizes, twins and barriers, none of which a network was trained \
                   on.",
            set: "test",
            only: |case| case != "penetration",
            cover: "col2x2",
        }),
        Box::new(Cases {
            title: "Fig. 22: penetration",
            lead: "A block that is pushed into a bed at 0.1 m/s, which no network was trained on.",
            set: "test",
            only: |case| case == "penetration",
            cover: "",
        }),
    ]
}
