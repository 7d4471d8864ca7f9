//! Continuum fields of grains by coarse graining (Goldhirsch 2010, Granular Matter 12, 239).
//!
//! Every grain is spread by a Gaussian $W$ of width $w$, cut off at $3 w$. With masses $m_i$, velocities
//! $\mathbf v_i$ and the out-of-plane thickness $t$,
//!
//! $$ \rho = \frac{1}{t} \sum_i m_i W(\mathbf x - \mathbf x_i), \qquad
//! \rho \mathbf V = \frac{1}{t} \sum_i m_i \mathbf v_i W, \qquad
//! \boldsymbol\sigma = \frac{1}{t} \sum_i \left( m_i \mathbf v_i' \otimes \mathbf v_i'
//! + \sum_c \mathbf f^{ic} \otimes \mathbf a^{ic} \right) W, $$
//!
//! where $\mathbf v_i' = \mathbf v_i - \mathbf V$ and $\mathbf a^{ic}$ is the arm to contact $c$. A contact acts
//! at the centres of its two grains instead of along the line between them: the same to second order in the
//! grain's size over $w$.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use super::packed::GrainState;

/// Where the Gaussian ends, in widths.
const REACH: f64 = 3.0;
/// Bins in a reach: small ones hold fewer grains that are out of reach.
const BINS_IN_REACH: f64 = 2.0;
/// Most bins along an axis.
const MAX_BINS: f64 = 2048.0;

/// Continuum fields at one place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Continuum {
    /// Bulk density (kg/m³).
    pub density: f64,
    /// Area of grains over area.
    pub solid_fraction: f64,
    /// Mean velocity, weighted by mass (m/s); zero where there is nothing.
    pub velocity: Vector2<f64>,
    /// Gradient of that velocity, `L_ij = dv_i/dx_j` (1/s).
    pub velocity_gradient: Matrix2<f64>,
    /// Cauchy stress with its kinetic part (Pa), compression positive.
    pub stress: Matrix2<f64>,
}

/// The part of the fields that needs no forces: all that means over grains need.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Flow {
    /// Area of grains over area.
    pub solid_fraction: f64,
    /// Gradient of the mean velocity, `L_ij = dv_i/dx_j` (1/s).
    pub velocity_gradient: Matrix2<f64>,
}

/// What the sums for a flow need of a grain, close together in memory.
#[derive(Clone, Copy, Default)]
struct Sample {
    x: Vector2<f64>,
    momentum: Vector2<f64>,
    mass: f64,
    area: f64,
}

impl Sample {
    fn of(grain: &GrainState) -> Self {
        Self {
            x: grain.x.into(),
            momentum: grain.mass * Vector2::from(grain.v),
            mass: grain.mass,
            area: std::f64::consts::PI * grain.r * grain.r,
        }
    }
}

/// Entries of [`Gaussian`]: linear between them it is right to 3e-6 of its peak, and faster than `exp`.
const ENTRIES: usize = 1024;

/// $W / t$ over the square of the distance, up to the end of its reach.
struct Gaussian {
    /// Entries in 1 m².
    entries: f64,
    /// At the beginning and the end of each entry.
    value: Vec<[f64; 2]>,
}

impl Gaussian {
    fn new(width: f64, thickness: f64) -> Self {
        // Normalises the Gaussian within its reach.
        let inside = 1.0 - (-0.5 * REACH * REACH).exp();
        let peak = 1.0 / (2.0 * std::f64::consts::PI * width * width * inside * thickness);
        let square = |k: usize| REACH * REACH * k as f64 / ENTRIES as f64;
        let value = |k: usize| peak * (-0.5 * square(k)).exp();
        let value = (0..ENTRIES).map(|k| [value(k), value(k + 1)]).collect();
        Self { entries: ENTRIES as f64 / (REACH * width).powi(2), value }
    }

    /// The value at the square of a distance (m²), if it is within reach.
    #[inline]
    fn at(&self, square: f64) -> Option<f64> {
        let place = square * self.entries;
        if !(0.0..ENTRIES as f64).contains(&place) {
            return None;
        }
        let entry = place as u32;
        let [from, to] = self.value[entry as usize];
        Some(from + (place - f64::from(entry)) * (to - from))
    }
}

/// Grains in bins, ready to be coarse grained.
pub struct CoarseGraining<'a> {
    states: &'a [GrainState],
    gaussian: Gaussian,
    /// Width of the Gaussian (m).
    width: f64,
    thickness: f64,
    corner: [f64; 2],
    /// Side of a bin (m).
    side: f64,
    bins: [usize; 2],
    /// Grains of bin `k`, row by row: `start[k]..start[k + 1]`.
    start: Vec<usize>,
    /// Indices of the grains in this order, and the grains.
    order: Vec<u32>,
    samples: Vec<Sample>,
}

impl<'a> CoarseGraining<'a> {
    /// Prepares grains of `thickness` (m) for fields of a `width` (m).
    pub fn new(states: &'a [GrainState], thickness: f64, width: f64) -> Self {
        let bound = |k: usize, pick: fn(f64, f64) -> f64| {
            states.par_iter().map(|grain| grain.x[k]).reduce_with(pick).unwrap_or_default()
        };
        let corner = [0, 1].map(|k| bound(k, f64::min));
        let extent = [0, 1].map(|k| bound(k, f64::max) - corner[k]);
        let side = (REACH * width / BINS_IN_REACH).max(extent[0].max(extent[1]) / MAX_BINS);
        let bins = extent.map(|length| (length / side) as usize + 1);
        let bin = |grain: &GrainState| {
            let [i, j] = [0, 1].map(|k| ((grain.x[k] - corner[k]) / side) as usize);
            j.min(bins[1] - 1) * bins[0] + i.min(bins[0] - 1)
        };
        let bin_of: Vec<usize> = states.par_iter().map(bin).collect();
        let mut start = vec![0; bins[0] * bins[1] + 1];
        for bin in &bin_of {
            start[bin + 1] += 1;
        }
        for k in 1..start.len() {
            start[k] += start[k - 1];
        }
        let mut next = start.clone();
        let mut order = vec![0; states.len()];
        for (index, &bin) in bin_of.iter().enumerate() {
            order[next[bin]] = index as u32;
            next[bin] += 1;
        }
        let samples = order.par_iter().map(|&k| Sample::of(&states[k as usize])).collect();
        let gaussian = Gaussian::new(width, thickness);
        Self { states, gaussian, width, thickness, corner, side, bins, start, order, samples }
    }

    /// The fields at each of some places (m). The same bits for any number of threads.
    pub fn at_all(&self, places: &[[f64; 2]]) -> Vec<Continuum> {
        places.par_iter().map(|&x| self.at(x)).collect()
    }

    /// The flow at a place (m).
    pub(super) fn flow_at(&self, x: [f64; 2]) -> Flow {
        let mut sums = Sums::default();
        self.gather(x, |k, weight, branch| sums.add(&self.samples[k], weight, branch));
        if sums.mass == 0.0 {
            return Flow::default();
        }
        Flow {
            solid_fraction: sums.area * self.thickness,
            velocity_gradient: sums.velocity_gradient(self.width),
        }
    }

    /// The fields at a place (m).
    pub fn at(&self, x: [f64; 2]) -> Continuum {
        let mut sums = Sums::default();
        // Sums of m v (x) v W and of the contacts.
        let (mut flux, mut virial) = (Matrix2::zeros(), Matrix2::zeros());
        self.gather(x, |k, weight, branch| {
            let sample = &self.samples[k];
            sums.add(sample, weight, branch);
            flux += weight / sample.mass * sample.momentum * sample.momentum.transpose();
            virial += weight * self.states[self.order[k] as usize].virial;
        });
        if sums.mass == 0.0 {
            return Continuum::default();
        }
        let velocity = sums.momentum / sums.mass;
        let stress: Matrix2<f64> = virial + flux - sums.momentum * velocity.transpose();
        Continuum {
            density: sums.mass,
            solid_fraction: sums.area * self.thickness,
            velocity,
            velocity_gradient: sums.velocity_gradient(self.width),
            stress: 0.5 * (stress + stress.transpose()),
        }
    }

    /// Passes the grains around a place with their weights $W / t$ and the branches from them to the place.
    fn gather(&self, x: [f64; 2], mut add: impl FnMut(usize, f64, Vector2<f64>)) {
        let at = Vector2::from(x);
        for k in self.near(x) {
            let branch = at - self.samples[k].x;
            if let Some(weight) = self.gaussian.at(branch.norm_squared()) {
                add(k, weight, branch);
            }
        }
    }

    /// Grains in the bins around a place.
    fn near(&self, x: [f64; 2]) -> impl Iterator<Item = usize> {
        // Casts saturate: far outside of the bins a range is empty.
        let [columns, rows] = [0, 1].map(|k| {
            let at = (x[k] - self.corner[k]) / self.side;
            let end = ((at + BINS_IN_REACH + 1.0) as usize).min(self.bins[k]);
            [((at - BINS_IN_REACH) as usize).min(end), end]
        });
        (rows[0]..rows[1]).flat_map(move |row| {
            let [first, end] = columns.map(|column| self.start[row * self.bins[0] + column]);
            first..end
        })
    }
}

/// Sums over grains with weight $W / t$, and of its gradient $-W (\mathbf x - \mathbf x_i) / w^2$, without $-1 / w^2$.
#[derive(Default)]
struct Sums {
    mass: f64,
    area: f64,
    momentum: Vector2<f64>,
    /// $\sum m W (\mathbf x - \mathbf x_i)$.
    mass_moment: Vector2<f64>,
    /// $\sum m \mathbf v \otimes (\mathbf x - \mathbf x_i) W$.
    momentum_moment: Matrix2<f64>,
}

impl Sums {
    #[inline]
    fn add(&mut self, sample: &Sample, weight: f64, branch: Vector2<f64>) {
        let arm = weight * branch;
        self.mass += sample.mass * weight;
        self.area += sample.area * weight;
        self.momentum += weight * sample.momentum;
        self.mass_moment += sample.mass * arm;
        self.momentum_moment += sample.momentum * arm.transpose();
    }

    /// The gradient of the mean velocity, where there is mass.
    fn velocity_gradient(&self, width: f64) -> Matrix2<f64> {
        let velocity = self.momentum / self.mass;
        let difference = velocity * self.mass_moment.transpose() - self.momentum_moment;
        difference / (self.mass * width * width)
    }
}

/// Part of a Gaussian of `width` (m) around `x` that lies inside a domain from the origin to `size` (m) and
/// outside of boxes, each given by its lower left and upper right corner (m). Densities beside a wall are too
/// small by this factor.
pub(super) fn free_share(x: [f64; 2], width: f64, size: [f64; 2], boxes: &[[[f64; 2]; 2]]) -> f64 {
    let between = |k: usize, from: f64, to: f64| {
        let below = |edge: f64| 0.5 * libm::erf((edge - x[k]) / (width * std::f64::consts::SQRT_2));
        below(to) - below(from)
    };
    let within = |[min, max]: &[[f64; 2]; 2]| {
        // Parts of a box outside of the domain count once.
        let [a, b] = [0, 1].map(|k| [min[k].max(0.0), max[k].min(size[k])]);
        if a[0] < a[1] && b[0] < b[1] {
            between(0, a[0], a[1]) * between(1, b[0], b[1])
        } else {
            0.0
        }
    };
    let near = |[min, max]: &&[[f64; 2]; 2]| {
        (0..2).all(|k| x[k] > min[k] - REACH * width && x[k] < max[k] + REACH * width)
    };
    let whole = within(&[[0.0; 2], size]);
    let blocked: f64 = boxes.iter().filter(near).map(within).sum();
    whole - blocked
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    const THICKNESS: f64 = 0.5;
    const RADIUS: f64 = 0.01;

    /// A square lattice of touching discs around the origin, `n` to each side.
    fn lattice(n: i32, of: impl Fn(&mut GrainState)) -> Vec<GrainState> {
        let places = (-n..=n).flat_map(|j| (-n..=n).map(move |i| [i, j]));
        let grain = |place: [i32; 2]| {
            let x = place.map(|k| 2.0 * RADIUS * f64::from(k));
            let mut grain = GrainState { x, r: RADIUS, mass: 3.0, ..GrainState::default() };
            of(&mut grain);
            grain
        };
        places.map(grain).collect()
    }

    fn at_origin(states: &[GrainState]) -> Continuum {
        // Off the lattice points, and wider than the lattice's spacing.
        CoarseGraining::new(states, THICKNESS, 3.0 * RADIUS).at([0.3 * RADIUS, -0.2 * RADIUS])
    }

    #[test]
    fn a_square_lattice_has_its_density_and_solid_fraction() {
        let fields = at_origin(&lattice(10, |_| ()));
        let density = 3.0 / (4.0 * RADIUS * RADIUS * THICKNESS);
        assert!((fields.density / density - 1.0).abs() < 5.0e-3, "{}", fields.density);
        assert!((fields.solid_fraction - 0.25 * PI).abs() < 5.0e-3);
        assert_eq!(fields.velocity, Vector2::zeros());
        assert_eq!(fields.stress, Matrix2::zeros());
    }

    #[test]
    fn an_affine_motion_has_its_gradient_and_little_stress() {
        let l = Matrix2::new(0.3, -1.0, 2.0, 0.5);
        let drift = Vector2::new(7.0, -5.0);
        let states = lattice(10, |grain| grain.v = (l * Vector2::from(grain.x) + drift).into());
        let fields = at_origin(&states);
        assert!((fields.velocity_gradient - l).norm() < 0.05 * l.norm(), "{fields:?}");
        let graining = CoarseGraining::new(&states, THICKNESS, 3.0 * RADIUS);
        let flow = graining.flow_at([0.3 * RADIUS, -0.2 * RADIUS]);
        assert_eq!(
            (flow.solid_fraction, flow.velocity_gradient),
            (fields.solid_fraction, fields.velocity_gradient)
        );
        let there = l * Vector2::new(0.3 * RADIUS, -0.2 * RADIUS) + drift;
        assert!((fields.velocity - there).norm() < 1.0e-3);
        // What is left is the motion within the width: rho w² L L^T.
        let inner = fields.density * (3.0 * RADIUS).powi(2) * (l * l.transpose());
        assert!((fields.stress - inner).norm() < 0.1 * inner.norm(), "{fields:?}");
    }

    #[test]
    fn random_motion_is_a_pressure_and_contacts_are_a_stress() {
        let signs =
            |x: [f64; 2]| x.map(|x| if (x / RADIUS).round() % 4.0 == 0.0 { 1.0 } else { -1.0 });
        let virial = Matrix2::new(4.0, 1.0, 3.0, 2.0);
        let states = lattice(10, |grain| {
            let [a, b] = signs(grain.x);
            grain.v = [2.0 * a, 3.0 * b];
            grain.virial = virial;
        });
        let fields = at_origin(&states);
        let kinetic = fields.density * Matrix2::new(4.0, 0.0, 0.0, 9.0);
        let symmetric = Matrix2::new(4.0, 2.0, 2.0, 2.0) * fields.density / 3.0;
        assert!((fields.stress - kinetic - symmetric).norm() < 0.03 * fields.stress.norm());
    }

    #[test]
    fn the_fields_of_all_places_hold_all_mass() {
        let states = lattice(3, |grain| grain.mass = 1.0 + grain.x[0]);
        let fine = 0.4 * RADIUS;
        let places: Vec<_> = (-60..=60)
            .flat_map(|j| (-60..=60).map(move |i| [f64::from(i) * fine, f64::from(j) * fine]))
            .collect();
        let graining = CoarseGraining::new(&states, THICKNESS, 2.0 * RADIUS);
        let mass: f64 =
            graining.at_all(&places).iter().map(|f| f.density * fine * fine * THICKNESS).sum();
        assert!((mass / 49.0 - 1.0).abs() < 2.0e-3, "{mass}");
        assert_eq!(graining.at([10.0, 0.0]), Continuum::default());
    }

    #[test]
    fn walls_and_boxes_leave_a_part_of_the_surroundings() {
        let size = [2.0, 1.0];
        let share = |x, boxes: &[_]| free_share(x, 0.01, size, boxes);
        assert!((share([1.0, 0.5], &[]) - 1.0).abs() < 1.0e-12);
        assert!((share([0.0, 0.5], &[]) - 0.5).abs() < 1.0e-12);
        assert!((share([2.0, 1.0], &[]) - 0.25).abs() < 1.0e-12);
        // Beside a box, and on its corner.
        let boxes = [[[0.5, 0.0], [0.7, 0.3]]];
        assert!((share([0.5, 0.1], &boxes) - 0.5).abs() < 1.0e-12);
        assert!((share([0.7, 0.3], &boxes) - 0.75).abs() < 1.0e-12);
        assert!((share([1.5, 0.5], &boxes) - 1.0).abs() < 1.0e-12);
    }
}
