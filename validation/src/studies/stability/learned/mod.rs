//! The learned simulators, pushed beyond what they were trained on.

pub mod at_rest;
pub mod disturbed;
pub mod length;
pub mod range;
pub mod roll;
pub mod walls;
