//! Numbers of others that the report compares with.

pub mod discs;
pub mod paper;
pub mod runout;
