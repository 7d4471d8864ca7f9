//! Scaling laws for the runout of collapsing columns.

/// A law of the literature.
pub struct Law {
    /// Source and material.
    pub name: &'static str,
    /// Runout `(L - L0) / L0` of an aspect ratio `H / L0`.
    pub runout: fn(f64) -> f64,
}

/// Experiments and discrete simulations.
pub const LAWS: [Law; 3] = [
    Law {
        name: "Lube et al. 2005, sand",
        runout: |a| if a < 2.3 { 1.2 * a } else { 1.9 * a.powf(2.0 / 3.0) },
    },
    Law {
        name: "Staron & Hinch 2005, discs",
        runout: |a| if a < 2.0 { 2.5 * a } else { 3.25 * a.powf(0.7) },
    },
    Law {
        name: "aluminium rods, arXiv 1512.05180",
        runout: |a| if a < 1.5 { 3.25 * a.powf(0.96) } else { 3.80 * a.powf(0.73) },
    },
];
