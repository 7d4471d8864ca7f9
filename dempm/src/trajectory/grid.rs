//! Fields on a grid in a trajectory.

/// The grid, which never changes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StaticGrid {
    /// Width of the coarse graining, m.
    pub width: f64,
    /// x of the nodes of a row, m.
    pub x: Vec<f64>,
    /// y of the rows, m.
    pub y: Vec<f64>,
}

/// Fields at one time: one entry a node, row by row from the bottom.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GridFrame {
    /// Bulk density, kg/m³.
    pub density: Vec<f32>,
    /// Velocity, m/s; zero where there is nothing.
    pub velocity: Vec<[f32; 2]>,
    /// Cauchy stress (xx, xy, yx, yy), Pa, tension positive.
    pub stress: Vec<[f32; 4]>,
}
