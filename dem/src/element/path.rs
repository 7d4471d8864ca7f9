//! The recorded path: averaged rows and their summary.

use nalgebra::Matrix2;

use crate::homogenise::inertial_number;
use crate::parameters::RveParameters;
use crate::state::RveState;

/// One sample of a path: time and strain at its end, everything else averaged over the interval
/// since the row before.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Time (s).
    pub t: f64,
    /// `∫ L dt`.
    pub strain: Matrix2<f64>,
    /// Cauchy stress (Pa), tension positive.
    pub stress: Matrix2<f64>,
    /// Area of the discs over the area of the cell.
    pub solid_fraction: f64,
    /// Contacts per disc.
    pub coordination: f64,
    /// Inertial number of the interval's mean velocity gradient, at its mean pressure and the mean
    /// diameter; infinite without pressure.
    pub inertial_number: f64,
}

impl Row {
    /// Names of [`Row::values`].
    pub const COLUMNS: [&str; 12] = [
        "t",
        "exx",
        "exy",
        "eyx",
        "eyy",
        "sxx",
        "sxy",
        "syx",
        "syy",
        "solid_fraction",
        "coordination",
        "inertial_number",
    ];

    /// The numbers of the row, in the order of [`Row::COLUMNS`].
    pub fn values(&self) -> [f64; 12] {
        let (e, s) = (&self.strain, &self.stress);
        [
            self.t,
            e[(0, 0)],
            e[(0, 1)],
            e[(1, 0)],
            e[(1, 1)],
            s[(0, 0)],
            s[(0, 1)],
            s[(1, 0)],
            s[(1, 1)],
            self.solid_fraction,
            self.coordination,
            self.inertial_number,
        ]
    }

    /// A single state at rest, at time `t` (s) and `strain`.
    pub(crate) fn at(state: &RveState, t: f64, strain: Matrix2<f64>, p: &RveParameters) -> Self {
        let mut sampler = Sampler::default();
        sampler.add(state, &Matrix2::zeros());
        sampler.row(t, strain, p)
    }

    /// Mean pressure (Pa), compression positive.
    pub fn pressure(&self) -> f64 {
        -0.5 * self.stress.trace()
    }
}

/// `sin phi = q / p` with `q = (s1 - s2) / 2` and `p = (s1 + s2) / 2`, in either sign convention;
/// 0 without pressure.
pub fn sin_phi(stress: &Matrix2<f64>) -> f64 {
    let p = 0.5 * stress.trace().abs();
    let q = (0.5 * (stress[(0, 0)] - stress[(1, 1)])).hypot(stress[(0, 1)]);
    if p > 0.0 { q / p } else { 0.0 }
}

/// Sums over the macro steps of one interval.
#[derive(Debug, Default)]
pub(super) struct Sampler {
    steps: f64,
    velocity_gradient: Matrix2<f64>,
    stress: Matrix2<f64>,
    solid_fraction: f64,
    coordination: f64,
}

impl Sampler {
    /// Adds a macro step under the velocity gradient `l` (1/s) that ended at `state`.
    pub fn add(&mut self, state: &RveState, l: &Matrix2<f64>) {
        self.steps += 1.0;
        self.velocity_gradient += l;
        self.stress -= state.stress;
        self.solid_fraction += state.solid_fraction;
        self.coordination += state.coordination;
    }

    /// The row of the interval that ends at time `t` (s) and `strain`; a new interval begins.
    pub fn row(&mut self, t: f64, strain: Matrix2<f64>, p: &RveParameters) -> Row {
        let sum = std::mem::take(self);
        let stress = sum.stress / sum.steps;
        Row {
            t,
            strain,
            stress,
            solid_fraction: sum.solid_fraction / sum.steps,
            coordination: sum.coordination / sum.steps,
            // The grains move with their scaled mass.
            inertial_number: inertial_number(
                &(sum.velocity_gradient / sum.steps),
                -0.5 * stress.trace(),
                p.grains.mean_diameter(),
                p.grains.mass_scale * p.grains.grain_density,
            ),
        }
    }
}

/// Summary of the rows of a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Largest `sin phi` of a row.
    pub peak_sin_phi: f64,
    /// Strain of that row.
    pub peak_strain: Matrix2<f64>,
    /// Mean `sin phi` of the last third of the rows, as all `late` values: the critical state if the
    /// stage is long enough.
    pub late_sin_phi: f64,
    /// Mean pressure (Pa), compression positive.
    pub late_pressure: f64,
    /// Mean solid fraction.
    pub late_solid_fraction: f64,
    /// Mean contacts per disc.
    pub late_coordination: f64,
    /// Mean inertial number.
    pub late_inertial_number: f64,
}

/// Summary of the rows of one stage; `None` without rows.
pub fn summary(rows: &[Row]) -> Option<Summary> {
    let peak = rows.iter().max_by(|a, b| sin_phi(&a.stress).total_cmp(&sin_phi(&b.stress)))?;
    let late = &rows[rows.len() - rows.len().div_ceil(3)..];
    let mean = |f: &dyn Fn(&Row) -> f64| late.iter().map(f).sum::<f64>() / late.len() as f64;
    Some(Summary {
        peak_sin_phi: sin_phi(&peak.stress),
        peak_strain: peak.strain,
        late_sin_phi: mean(&|r| sin_phi(&r.stress)),
        late_pressure: mean(&Row::pressure),
        late_solid_fraction: mean(&|r| r.solid_fraction),
        late_coordination: mean(&|r| r.coordination),
        late_inertial_number: mean(&|r| r.inertial_number),
    })
}
