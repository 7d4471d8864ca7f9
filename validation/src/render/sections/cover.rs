//! The scene on the first screen.

use crate::studies::sweep::TruthScene;
use crate::suite::Suite;

/// Whether the first screen shows this scene: Col2x2, or the only one of the quick suite.
pub(super) fn stands_for_all(scene: &TruthScene, suite: Suite) -> bool {
    scene.name == suite.pick("Small column", "Col2x2")
}
