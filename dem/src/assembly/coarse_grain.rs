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

/// Grains in bins, ready to be coarse grained.
pub struct CoarseGraining {
    /// Width of the Gaussian (m).
    width: f64,
    thickness: f64,
    corner: [f64; 2],
    /// Side of a bin (m), at least the reach.
    side: f64,
    bins: [usize; 2],
    /// Grains of bin `k`, row by row: `start[k]..start[k + 1]`.
    start: Vec<usize>,
    grains: Vec<GrainState>,
    /// Index of each among the given states.
    index: Vec<u32>,
}

/// The motion of the grains around one of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocalMotion {
    /// Area of grains over area.
    pub solid_fraction: f64,
    /// Gradient of the mean velocity, `L_ij = dv_i/dx_j` (1/s).
    pub velocity_gradient: Matrix2<f64>,
}

impl CoarseGraining {
    /// Prepares grains of `thickness` (m) for fields of a `width` (m).
    pub fn new(states: &[GrainState], thickness: f64, width: f64) -> Self {
        let bound = |k: usize, pick: fn(f64, f64) -> f64| {
            states.iter().map(|grain| grain.x[k]).reduce(pick).unwrap_or_default()
        };
        let corner = [0, 1].map(|k| bound(k, f64::min));
        let extent = [0, 1].map(|k| bound(k, f64::max) - corner[k]);
        let side = (REACH * width).max(extent[0].max(extent[1]) / MAX_BINS);
        let bins = extent.map(|length| (length / side) as usize + 1);
        let bin = |grain: &GrainState| {
            let [i, j] = [0, 1].map(|k| ((grain.x[k] - corner[k]) / side) as usize);
            j.min(bins[1] - 1) * bins[0] + i.min(bins[0] - 1)
        };
        let mut start = vec![0; bins[0] * bins[1] + 1];
        for grain in states {
            start[bin(grain) + 1] += 1;
        }
        for k in 1..start.len() {
            start[k] += start[k - 1];
        }
        let mut next = start.clone();
        let mut grains = vec![GrainState::default(); states.len()];
        let mut index = vec![0; states.len()];
        for (k, grain) in states.iter().enumerate() {
            let place = &mut next[bin(grain)];
            grains[*place] = *grain;
            index[*place] = k as u32;
            *place += 1;
        }
        Self { width, thickness, corner, side, bins, start, grains, index }
    }

    /// Solid fraction and velocity gradient at each of the given grains.
    pub fn motion_at_grains(&self) -> Vec<LocalMotion> {
        let particles: Vec<Particle> = self.grains.iter().map(Particle::from).collect();
        // Neighbours follow each other in this order.
        let sorted: Vec<LocalMotion> =
            particles.par_iter().map(|at| self.motion_at(at.x, &particles)).collect();
        let mut motion = vec![LocalMotion::default(); sorted.len()];
        for (&k, local) in self.index.iter().zip(sorted) {
            motion[k as usize] = local;
        }
        motion
    }

    /// As [`Self::at`], without stress.
    fn motion_at(&self, x: [f64; 2], particles: &[Particle]) -> LocalMotion {
        let reach2 = (REACH * self.width).powi(2);
        let inverse = 1.0 / (self.width * self.width);
        let (mut area, mut mass) = (0.0, 0.0);
        let (mut momentum, mut mass_gradient) = ([0.0; 2], [0.0; 2]);
        let mut momentum_gradient = [[0.0; 2]; 2];
        for p in self.ranges(x).flat_map(|range| &particles[range]) {
            let d = [x[0] - p.x[0], x[1] - p.x[1]];
            let square = d[0] * d[0] + d[1] * d[1];
            if square >= reach2 {
                continue;
            }
            let weight = (-0.5 * square * inverse).exp();
            let m = p.mass * weight;
            area += p.area * weight;
            mass += m;
            for i in 0..2 {
                momentum[i] += m * p.v[i];
                mass_gradient[i] -= m * inverse * d[i];
                for j in 0..2 {
                    momentum_gradient[i][j] -= m * p.v[i] * inverse * d[j];
                }
            }
        }
        let gradient = |i: usize, j: usize| {
            (momentum_gradient[i][j] - momentum[i] / mass * mass_gradient[j]) / mass
        };
        LocalMotion {
            solid_fraction: area * self.peak(),
            velocity_gradient: Matrix2::from_fn(gradient),
        }
    }

    /// Height of the Gaussian (1/m²), normalised within its reach.
    fn peak(&self) -> f64 {
        let inside = 1.0 - (-0.5 * REACH * REACH).exp();
        1.0 / (2.0 * std::f64::consts::PI * self.width * self.width * inside)
    }

    /// The fields at each of some places (m). The same bits for any number of threads.
    pub fn at_all(&self, places: &[[f64; 2]]) -> Vec<Continuum> {
        places.par_iter().map(|&x| self.at(x)).collect()
    }

    /// The fields at a place (m).
    pub fn at(&self, x: [f64; 2]) -> Continuum {
        let mut sums = Sums::default();
        let reach = REACH * self.width;
        let inverse = 1.0 / (self.width * self.width);
        let peak = self.peak() / self.thickness;
        for grain in self.near(x) {
            let d = Vector2::new(x[0] - grain.x[0], x[1] - grain.x[1]);
            let square = d.norm_squared();
            if square < reach * reach {
                let weight = peak * (-0.5 * square * inverse).exp();
                sums.add(grain, weight, -inverse * weight * d);
            }
        }
        sums.fields(self.thickness)
    }

    /// Grains in the bins around a place.
    fn near(&self, x: [f64; 2]) -> impl Iterator<Item = &GrainState> {
        self.ranges(x).flat_map(|range| &self.grains[range])
    }

    /// Ranges of the grains in the bins around a place.
    fn ranges(&self, x: [f64; 2]) -> impl Iterator<Item = std::ops::Range<usize>> {
        // Casts saturate: far outside of the bins a range is empty.
        let [columns, rows] = [0, 1].map(|k| {
            let at = (x[k] - self.corner[k]) / self.side;
            let end = ((at + 2.0) as usize).min(self.bins[k]);
            [((at - 1.0) as usize).min(end), end]
        });
        (rows[0]..rows[1]).map(move |row| {
            let [first, end] = columns.map(|column| self.start[row * self.bins[0] + column]);
            first..end
        })
    }
}

/// What the motion of grains is made of.
struct Particle {
    x: [f64; 2],
    v: [f64; 2],
    mass: f64,
    area: f64,
}

impl From<&GrainState> for Particle {
    fn from(grain: &GrainState) -> Self {
        let area = std::f64::consts::PI * grain.r * grain.r;
        Self { x: grain.x, v: grain.v, mass: grain.mass, area }
    }
}

/// Sums over grains with weight $W / t$.
#[derive(Default)]
struct Sums {
    mass: f64,
    area: f64,
    momentum: Vector2<f64>,
    /// $\sum m \mathbf v \otimes \mathbf v W$.
    flux: Matrix2<f64>,
    virial: Matrix2<f64>,
    /// $\sum m \nabla W$.
    mass_gradient: Vector2<f64>,
    /// $\sum m \mathbf v \otimes \nabla W$.
    momentum_gradient: Matrix2<f64>,
}

impl Sums {
    fn add(&mut self, grain: &GrainState, weight: f64, gradient: Vector2<f64>) {
        let velocity = Vector2::from(grain.v);
        let mass = grain.mass * weight;
        self.mass += mass;
        self.area += std::f64::consts::PI * grain.r * grain.r * weight;
        self.momentum += mass * velocity;
        self.flux += mass * velocity * velocity.transpose();
        self.virial += weight * grain.virial;
        self.mass_gradient += grain.mass * gradient;
        self.momentum_gradient += grain.mass * velocity * gradient.transpose();
    }

    fn fields(&self, thickness: f64) -> Continuum {
        if self.mass == 0.0 {
            return Continuum::default();
        }
        let velocity = self.momentum / self.mass;
        let stress = self.virial + self.flux - self.momentum * velocity.transpose();
        let gradient = self.momentum_gradient - velocity * self.mass_gradient.transpose();
        Continuum {
            density: self.mass,
            solid_fraction: self.area * thickness,
            velocity,
            velocity_gradient: gradient / self.mass,
            stress: 0.5 * (stress + stress.transpose()),
        }
    }
}

/// Part of a Gaussian of `width` (m) around `x` that lies inside a domain from the origin to `size` (m) and
/// outside of boxes, each given by its lower left and upper right corner (m). Densities beside a wall are too
/// small by this factor.
pub fn free_share(x: [f64; 2], width: f64, size: [f64; 2], boxes: &[[[f64; 2]; 2]]) -> f64 {
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
        let there = l * Vector2::new(0.3 * RADIUS, -0.2 * RADIUS) + drift;
        assert!((fields.velocity - there).norm() < 1.0e-3);
        // What is left is the motion within the width: rho w² L L^T.
        let inner = fields.density * (3.0 * RADIUS).powi(2) * (l * l.transpose());
        assert!((fields.stress - inner).norm() < 0.1 * inner.norm(), "{fields:?}");
    }

    #[test]
    fn motion_at_grains_is_that_of_the_fields() {
        let l = Matrix2::new(0.3, -1.0, 2.0, 0.5);
        let states = lattice(6, |grain| grain.v = (l * Vector2::from(grain.x)).into());
        let graining = CoarseGraining::new(&states, THICKNESS, 3.0 * RADIUS);
        for (grain, motion) in states.iter().zip(graining.motion_at_grains()) {
            let fields = graining.at(grain.x);
            assert!((motion.solid_fraction / fields.solid_fraction - 1.0).abs() < 1.0e-12);
            let error = (motion.velocity_gradient - fields.velocity_gradient).norm();
            assert!(error < 1.0e-10, "{error}");
        }
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
