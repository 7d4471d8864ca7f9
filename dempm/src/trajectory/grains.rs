//! Grains in a trajectory.

/// Properties of the grains of a run that never change. All arrays have one entry a grain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StaticGrains {
    /// Frames from one with grains to the next; the initial frame has them.
    pub every: usize,
    /// Radius, m.
    pub radius: Vec<f32>,
    /// Index of the column.
    pub column: Vec<u32>,
    /// Index of the point in whose square a grain starts.
    pub point: Vec<u32>,
}

/// The grains at one time, in the order of [`StaticGrains`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GrainFrame {
    /// Positions, m.
    pub position: Vec<[f32; 2]>,
    /// Velocities, m/s.
    pub velocity: Vec<[f32; 2]>,
    /// Mean stress in each grain from its contacts, Pa, compression positive.
    pub pressure: Vec<f32>,
}
