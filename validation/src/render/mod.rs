//! Measurements as tables, charts, sentences and pages.

pub mod animation;
pub mod block;
pub mod figure;
pub mod files;
pub mod html;
pub mod map;
pub mod overlay;
pub mod point_cloud;
pub mod report;
pub mod results;
pub mod rollouts;
pub mod section;
pub mod sections;
pub mod table;
