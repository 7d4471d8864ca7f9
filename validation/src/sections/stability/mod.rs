//! Each method pushed until it fails.
//!
//! One study per file: what is pushed, what counts as failure, the threshold measured and by theory,
//! and what the program said. Studies give plain data ([`Study`]), kept in the work directory, and
//! [`render`] turns them into blocks.

mod columns;
mod dem_dilute;
mod dem_overlap;
mod dem_precision;
mod dem_shear;
mod dem_size;
mod dem_step;
mod dem_thin;
mod mpm_crossing;
mod mpm_step;
mod mpm_transfer;
mod outcome;
mod packing;
mod render;
mod scene;
mod snapshot;
mod study;
mod threshold;

pub use outcome::Outcome;
pub use study::{Study, StudyError};
pub use threshold::Threshold;

use crate::block::Block;
use crate::context::{Context, Suite};
use crate::section::Section;

/// The sections of the chapter.
pub fn all() -> Vec<Box<dyn Section>> {
    vec![
        direct("MPM: the step", mpm_step::study, 5.0),
        direct("MPM: cell crossing", mpm_crossing::study, 10.0),
        direct("MPM: energy and viscosity", mpm_transfer::study, 10.0),
        direct("DEM: the step", dem_step::study, 8.0),
        direct("DEM: damping and mass scaling", dem_shear::study, 15.0),
        direct("DEM: thin cells", dem_thin::study, 8.0),
        direct("DEM: over-compression", dem_overlap::study, 3.0),
        direct("DEM: dilute flow and recompaction", dem_dilute::study, 5.0),
        direct("DEM: size of the RVE", dem_size::study, 5.0),
        direct("DEM: f32 against f64", dem_precision::study, 5.0),
        direct("Tall columns", columns::study, 15.0),
    ]
}

/// A study of the direct solver or its parts.
struct Direct {
    title: &'static str,
    study: fn(Suite) -> Result<Study, StudyError>,
    /// Expected time of the quick size (s).
    seconds: f64,
}

/// The full size takes about this many times as long.
const FULL: f64 = 20.0;

fn direct(
    title: &'static str,
    study: fn(Suite) -> Result<Study, StudyError>,
    seconds: f64,
) -> Box<dyn Section> {
    Box::new(Direct { title, study, seconds })
}

impl Section for Direct {
    fn title(&self) -> &'static str {
        self.title
    }

    fn estimate(&self, context: &Context) -> f64 {
        if context.work.has_cached(self.title, &key(context)) {
            return 0.0;
        }
        self.seconds * study::pick(context.suite, 1.0, FULL)
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let (suite, estimate) = (context.suite, self.estimate(context));
        let made = context.cached(self.title, &key(context), estimate, || Ok((self.study)(suite)?))?;
        Ok(render::blocks(&made)?)
    }
}

/// A study depends on its size and on the program.
fn key(context: &Context) -> String {
    format!("{:?} {}", context.suite, context.work.build())
}
