//! The sections of the chapter.

use super::direct::Direct;
use super::glance::Glance;
use super::learned::Learned;
use crate::render::section::Section;
use crate::studies::stability::{
    dem_dilute, dem_overlap, dem_precision, dem_shear, dem_size, dem_step, dem_thin, learned,
    mpm_crossing, mpm_step, mpm_transfer, tall_columns,
};

/// The sections of the chapter: a summary, then the studies.
pub fn all() -> Vec<Box<dyn Section>> {
    let mut studies: Vec<Box<dyn Section>> = Vec::new();
    studies.extend(direct().into_iter().map(|study| Box::new(study) as Box<dyn Section>));
    studies.extend(learned().into_iter().map(|study| Box::new(study) as Box<dyn Section>));
    let titles = studies.iter().map(|study| study.title()).collect();
    let mut all: Vec<Box<dyn Section>> = vec![Box::new(Glance { studies: titles })];
    all.append(&mut studies);
    all
}

fn direct() -> [Direct; 11] {
    [
        Direct {
            title: "MPM: the step",
            lead: "The longest stable step of the MPM, for each basis and scheme.",
            study: mpm_step::study,
            seconds: 5.0,
        },
        Direct {
            title: "MPM: cell crossing",
            lead: "How rough the stress becomes when points move through the grid.",
            study: mpm_crossing::study,
            seconds: 10.0,
        },
        Direct {
            title: "MPM: energy and viscosity",
            lead: "How much energy the transfers between points and grid lose.",
            study: mpm_transfer::study,
            seconds: 10.0,
        },
        Direct {
            title: "DEM: the step",
            lead: "The longest stable step of a packing, and of lattices with known spectra.",
            study: dem_step::study,
            seconds: 8.0,
        },
        Direct {
            title: "DEM: damping and mass scaling",
            lead: "How much damping and scaled masses change the strength of a packing.",
            study: dem_shear::study,
            seconds: 15.0,
        },
        Direct {
            title: "DEM: thin cells",
            lead: "Packings that are stretched until their cell is a few grains wide.",
            study: dem_thin::study,
            seconds: 8.0,
        },
        Direct {
            title: "DEM: over-compression",
            lead: "Packings that are compressed until discs pass through each other.",
            study: dem_overlap::study,
            seconds: 3.0,
        },
        Direct {
            title: "DEM: dilute flow and recompaction",
            lead: "Packings that are expanded until discs fly freely, and compressed again.",
            study: dem_dilute::study,
            seconds: 5.0,
        },
        Direct {
            title: "DEM: size of the RVE",
            lead: "How few discs still have the strength of the material.",
            study: dem_size::study,
            seconds: 5.0,
        },
        Direct {
            title: "DEM: f32 against f64",
            lead: "The smallest pressure that single precision still resolves.",
            study: dem_precision::study,
            seconds: 5.0,
        },
        Direct {
            title: "Tall columns",
            lead: "Columns up to 48 m high that collapse, and shafts full of packings.",
            study: tall_columns::study,
            seconds: 15.0,
        },
    ]
}

fn learned() -> [Learned; 5] {
    [
        Learned {
            title: "Learned: length of the rollout",
            lead: "Rollouts that go on long after a collapse has come to rest.",
            study: learned::rollout_length::study,
            seconds: 25.0,
        },
        Learned {
            title: "Learned: height, width, velocity",
            lead: "Columns that are taller, wider and faster than those of the training.",
            study: learned::training_range::study,
            seconds: 25.0,
        },
        Learned {
            title: "Learned: noise, mirror images, frames",
            lead: "Noise on the first frames, mirrored scenes, and frames of another interval.",
            study: learned::perturbed::study,
            seconds: 15.0,
        },
        Learned {
            title: "Learned: walls",
            lead: "A block that is thrown at a wall, ever faster.",
            study: learned::walls::study,
            seconds: 5.0,
        },
        Learned {
            title: "Learned: rest and penetration",
            lead: "Beds that should stay at rest, and a plate that is pushed into one.",
            study: learned::at_rest::study,
            seconds: 15.0,
        },
    ]
}
