//! The sections of the chapter.

use super::overview::Overview;
use super::scene::TruthSection;
use crate::render::section::Section;
use crate::studies::sweep::TruthScene;
use crate::suite::Suite;

/// The overview, then every scene.
pub fn all() -> Vec<Box<dyn Section>> {
    let scenes = TruthScene::of(Suite::Full).iter();
    let sections = scenes.map(|scene| Box::new(TruthSection { scene }) as Box<dyn Section>);
    std::iter::once(Box::new(Overview) as Box<dyn Section>).chain(sections).collect()
}
