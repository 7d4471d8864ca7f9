//! Hierarchical MPM x DEM: scene file -> simulation -> trajectory file.
pub mod check;
pub mod checkpoint;
pub mod device;
pub mod element;
pub mod export;
pub mod info;
pub mod packings;
pub mod plot;
pub mod rate;
pub mod record;
pub mod run;
pub mod rve_material;
pub mod scene;
pub mod simulation;
pub mod summary;
pub mod trajectory;
pub mod watch;
