//! The sections of the report, in its order. A new one is a file that implements
//! [`Section`](crate::section::Section) and a line here.

mod runs;
pub mod stability;

use crate::section::Chapter;

/// All chapters.
pub fn all() -> Vec<Chapter> {
    vec![
        Chapter { title: "Stability", sections: stability::all() },
        Chapter { title: "How it was made", sections: vec![Box::new(runs::Runs)] },
    ]
}
