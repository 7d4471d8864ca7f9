//! The paper (Zhao, Chen, Zhao, CMAME 433, 2025, 117536), side by side with what is here.

mod accuracy;
mod data;
pub mod networks;
mod resolutions;
mod times;
mod training;

use crate::section::Section;

/// The sections of the chapter.
pub fn all() -> Vec<Box<dyn Section>> {
    vec![
        Box::new(accuracy::Stated),
        Box::new(data::Data),
        Box::new(networks::Networks),
        Box::new(times::Times),
        Box::new(training::Training),
        Box::new(accuracy::Cases {
            title: "Fig. 9 and 10: validation cases",
            set: "valid",
            only: None,
        }),
        Box::new(accuracy::Ablation),
        Box::new(resolutions::Resolutions),
        Box::new(accuracy::Cases {
            title: "Fig. 17 to 21: test set",
            set: "test",
            only: Some(|case| case != "penetration"),
        }),
        Box::new(accuracy::Cases {
            title: "Fig. 22: penetration",
            set: "test",
            only: Some(|case| case == "penetration"),
        }),
    ]
}

/// A value for the column "ratio"; empty unless both are there.
fn ratio(paper: Option<f64>, ours: Option<f64>) -> String {
    match (paper, ours) {
        (Some(paper), Some(ours)) => crate::table::number(ours / paper),
        _ => String::new(),
    }
}

/// A value, or that the paper does not state it.
fn stated(value: Option<f64>) -> String {
    value.map_or("not stated".to_owned(), crate::table::number)
}
