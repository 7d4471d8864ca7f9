//! The sections of the report, in its order. A new one is a file that implements
//! [`Section`](crate::section::Section) and a line here.

mod columns;
mod elements;
mod needs;
pub mod paper;
mod rollout;
mod runs;
mod speed_accuracy;
pub mod stability;
mod yade;

use crate::section::Chapter;
use speed_accuracy::SpeedAccuracy;

/// All chapters.
pub fn all() -> Vec<Chapter> {
    vec![
        Chapter { title: "The paper, side by side", sections: paper::all() },
        Chapter {
            title: "Speed against accuracy",
            sections: vec![
                Box::new(SpeedAccuracy { case: 0, title: "Column of 1 m" }),
                Box::new(SpeedAccuracy { case: 1, title: "Col2x2" }),
                Box::new(SpeedAccuracy { case: 2, title: "Col5x3" }),
                Box::new(rollout::Column),
            ],
        },
        Chapter { title: "What a scene needs", sections: vec![Box::new(needs::Needs)] },
        Chapter { title: "Stability", sections: stability::all() },
        Chapter {
            title: "External truth",
            sections: vec![
                Box::new(columns::Columns),
                Box::new(elements::Elements),
                Box::new(yade::Yade),
            ],
        },
        Chapter { title: "How it was made", sections: vec![Box::new(runs::Runs)] },
    ]
}
