//! The sections of the chapter.

use super::grain_size::AsGrainsShrink;
use super::overview::Overview;
use super::scene::TruthSection;
use crate::render::section::Section;
use crate::studies::sweep::TruthScene;
use crate::suite::Suite;

/// The overview, then every scene, then other grains.
pub fn all() -> Vec<Box<dyn Section>> {
    let scenes = TruthScene::of(Suite::Full).iter();
    let sections = scenes.map(|scene| Box::new(TruthSection { scene }) as Box<dyn Section>);
    let overview: Box<dyn Section> = Box::new(Overview);
    let grains: Box<dyn Section> = Box::new(AsGrainsShrink);
    std::iter::once(overview).chain(sections).chain([grains]).collect()
}
