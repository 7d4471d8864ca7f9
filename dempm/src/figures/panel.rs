//! What a panel of a figure shows.

/// A panel: discs, solids, and a line of text above it. Lengths in m.
pub(super) struct Panel {
    /// Points or grains, from the back to the front.
    pub discs: Vec<Disc>,
    /// Boxes (x min, y min, x max, y max).
    pub boxes: Vec<[f64; 4]>,
    /// Segments (x1, y1, x2, y2).
    pub walls: Vec<[f64; 4]>,
    /// The text.
    pub label: String,
}

/// A point or grain.
pub(super) struct Disc {
    pub at: [f64; 2],
    pub radius: f64,
    pub paint: Paint,
}

/// What the colour of a disc shows.
#[derive(Clone, Copy)]
pub(super) enum Paint {
    /// A value on the colour scale.
    Value(f64),
    /// The number of its run.
    Run(usize),
}

impl Panel {
    /// The values on the colour scale.
    pub(super) fn values(&self) -> impl Iterator<Item = f64> + '_ {
        self.discs.iter().filter_map(|disc| match disc.paint {
            Paint::Value(value) => Some(value),
            Paint::Run(_) => None,
        })
    }
}
