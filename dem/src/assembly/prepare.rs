//! Filling a column with grains at rest: rain, settle, cut to height, relax with the friction of flow.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::boundary::{Boundary, Faces, Floor};
use super::error::AssemblyError;
use super::packed::{Grain, Packed, Partner};
use super::settling::{Settling, Start};
use super::state::Assembly;
use crate::grains::Grains;
use crate::real::Real;

/// A rectangle to be filled with grains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnBox {
    /// Lower left corner (m).
    pub corner: [f64; 2],
    /// Width and height (m).
    pub size: [f64; 2],
    /// Whether it carries its weight. Otherwise its grains hardly press on each other, as in the air.
    pub loaded: bool,
}

/// Solid fraction of settled grains, at most: sets how many are rained.
const DENSEST: f64 = 0.88;
/// More grains than fill the column, as the top layer is cut.
const OVERFILL: f64 = 1.04;
/// Decay of velocities (1/s) while grains fall, and once they hardly move; see [`settling_drag`].
const FALLING_DRAG: f64 = 2.0;
const RESTING_DRAG: f64 = 200.0;
/// Time (s) between two looks at the motion.
const LOOK: f64 = 0.01;
/// Mean kinetic energies, in units of the mean weight times the mean diameter: grains hardly move, so that the
/// column is formed; they have settled, though without friction single ones still rearrange; they are at rest.
const HARDLY_MOVING: f64 = 1.0e-3;
const SETTLED: f64 = 1.0e-5;
const AT_REST: f64 = 1.0e-7;
/// How long grains fall nearly freely, in times of a free fall from the top of the rain to that of the column.
const FALL: f64 = 1.2;
/// DEM step while grains fall and settle, over that of rest: still little more than half of the stable one.
const COARSE_STEP: f64 = 1.5;
/// Shortest settling, in looks, and longest, in times of a free fall from the top of the column.
const SHORTEST: usize = 5;
const LONGEST: f64 = 30.0;
/// Largest gap beside a grain, over its radius, and distance of grains over that of touching ones.
const GAP: f64 = 0.3;
const CLEARANCE: f64 = 1.001;
/// Solid fraction for the weight of a column.
const SOLID_FRACTION: f64 = 0.85;
/// Pressure at the base of a column that is not loaded (Pa).
const UNLOADED: f64 = 100.0;
/// The bottom's index among bodies.
const FLOOR: u32 = 2;

/// Fills a column with grains that are at rest within frictionless sides, on the floor of the domain if it
/// stands there. Grains are dropped with the friction of preparation; then what is above the column is
/// taken away, and the rest relaxes with the weight and the friction that it has in the scene.
///
/// # Errors
/// The column is too small for the grains, they do not come to rest, or a step fails.
pub fn prepare_column<R: Real>(
    grains: &Grains,
    boundary: &Boundary,
    gravity: [f64; 2],
    place: &ColumnBox,
    seed: u64,
    start: &mut Start<'_, R>,
) -> Result<Packed, AssemblyError> {
    let error = |reason: String| AssemblyError::Preparation { corner: place.corner, reason };
    let [width, height] = place.size;
    let largest = 2.0 * grains.radius_max;
    if width < largest || height < largest {
        return Err(error(format!("a grain of {largest} m is larger than {width} m x {height} m")));
    }
    // Grains settle under gravity even where the scene has none.
    let weight = if gravity[1] < 0.0 { gravity[1] } else { -9.81 };
    let rain = rain(grains, place, seed);
    let silo = silo(grains, boundary, place, &rain);
    let step = grains.preparation_step();
    let coarse = COARSE_STEP * step;

    let mut smooth = grains.clone();
    smooth.friction = grains.preparation_friction;
    let mut falling = start(Assembly::new(&smooth, &silo, [0.0, weight], coarse, &rain)?)?;
    falling.set_drag(FALLING_DRAG);
    let drop = (silo.size[1] - height).max(0.0);
    falling.advance((FALL * (2.0 * drop / -weight).sqrt() / coarse).ceil() as usize)?;
    let settling = Settle { drag: settling_drag(grains, height), weight, place };
    settling.run(&mut *falling, coarse, HARDLY_MOVING)?;

    let mut packed = falling.finish()?.packed();
    let top = place.corner[1] + height;
    let highest = packed.grains.iter().map(|grain| grain.x[1]).fold(f64::MIN, f64::max);
    if highest < top - grains.mean_diameter() {
        return Err(error(format!("grains settle to {:.3} m only", highest - place.corner[1])));
    }
    packed.retain(|grain| grain.x[1] < top);

    // Without the friction of flow at first, which would lock in the horizontal stress under what was cut.
    let mut cut = start(Assembly::new(&smooth, &silo, [0.0, weight], coarse, &packed)?)?;
    settling.run(&mut *cut, coarse, SETTLED)?;
    let packed = cut.finish()?.packed();
    let bulk_density = SOLID_FRACTION * grains.grain_density;
    let load = if place.loaded { weight } else { -UNLOADED / (bulk_density * height) };
    let mut relaxing = start(Assembly::new(grains, &silo, [0.0, load], step, &packed)?)?;
    settling.run(&mut *relaxing, step, AT_REST)?;
    let mut packed = relaxing.finish()?.packed();
    packed.retain(|grain| grain.x[1] < top);
    for grain in &mut packed.grains {
        (grain.v, grain.w) = ([0.0; 2], 0.0);
    }
    place_on_floor(&mut packed, grains, boundary, place);
    Ok(packed)
}

/// Turns the partners of contacts from those in the silo into those in the domain. The sides of the silo are no
/// bodies of the domain, and its bottom is one if the column stands on the floor.
fn place_on_floor(packed: &mut Packed, grains: &Grains, boundary: &Boundary, place: &ColumnBox) {
    packed.contacts.retain(|contact| match contact.partner {
        Partner::Body(body) => body == FLOOR && stands(place),
        Partner::Grain(_) | Partner::Floor(_) => true,
    });
    let floor = boundary.floor_grains(grains);
    let left = floor.iter().take_while(|(x, r)| x[0] + r <= place.corner[0]).count() as u32;
    for contact in &mut packed.contacts {
        if let Partner::Floor(index) = &mut contact.partner {
            *index += left;
        }
    }
}

/// Whether a column stands on the floor of the domain.
fn stands(place: &ColumnBox) -> bool {
    place.corner[1] <= 0.0
}

/// Decay of velocities (1/s) while a column settles: its lowest angular frequency, $\pi c / 2 h$ with the speed
/// $c = \sqrt{k_n / (t \rho)}$ of compression, so that it bounces with half the critical damping. Low columns
/// settle as fast with that of rest.
fn settling_drag(grains: &Grains, height: f64) -> f64 {
    let density = SOLID_FRACTION * grains.grain_density;
    let speed = (grains.normal_stiffness / (grains.thickness * density)).sqrt();
    (std::f64::consts::FRAC_PI_2 * speed / height).min(RESTING_DRAG)
}

/// How a column settles.
struct Settle<'a> {
    /// See [`settling_drag`].
    drag: f64,
    /// Gravity (m/s²), below zero.
    weight: f64,
    place: &'a ColumnBox,
}

impl Settle<'_> {
    /// Advances with drag, in steps of `dt` (s), until the kinetic energy is below `rest`, see [`AT_REST`].
    fn run<R: Real>(
        &self,
        settling: &mut dyn Settling<R>,
        dt: f64,
        rest: f64,
    ) -> Result<(), AssemblyError> {
        settling.set_drag(self.drag);
        let look = (LOOK / dt).ceil() as usize;
        let longest = LONGEST * (2.0 * self.place.size[1] / -self.weight).sqrt();
        let looks = (longest / LOOK).ceil() as usize + SHORTEST;
        for k in 1..=looks {
            settling.advance(look)?;
            let agitation = settling.agitation(-self.weight)?;
            if k >= SHORTEST && agitation < rest {
                return Ok(());
            }
            settling.set_drag(if agitation < HARDLY_MOVING { RESTING_DRAG } else { self.drag });
        }
        let reason = format!("the grains are not at rest after {longest:.1} s");
        Err(AssemblyError::Preparation { corner: self.place.corner, reason })
    }
}

/// Grains of random radii in rows, each as low as those below let it lie at its place in the row.
fn rain(grains: &Grains, place: &ColumnBox, seed: u64) -> Packed {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let [width, height] = place.size;
    let (a, b) = (grains.radius_min, grains.radius_max);
    let mean_square = (a * a + a * b + b * b) / 3.0;
    let area = OVERFILL * width * (height + 2.0 * b);
    let count = (DENSEST * area / (std::f64::consts::PI * mean_square)).ceil() as usize;
    let mut fallen: Vec<Grain> = Vec::with_capacity(count);
    // Grains in vertical strips that are as wide as two grains reach, each with the greatest height in its strip so far:
    // no grain before it reaches higher than that and the longest reach.
    let longest = CLEARANCE * (b + b);
    let strip = |x: f64| (x / longest) as usize + 1;
    let mut strips: Vec<Vec<(usize, f64)>> = vec![Vec::new(); strip(width) + 2];
    let mut end = 0.0;
    for index in 0..count {
        let r = rng.random_range(a..=b);
        let gap = rng.random_range(0.0..GAP) * r;
        let fits = end + gap + 2.0 * r <= width;
        let x = r + if fits { end + gap } else { 0.0 };
        end = x + r;
        let mut y = r;
        for below in &strips[strip(x) - 1..=strip(x) + 1] {
            for &(other, highest) in below.iter().rev() {
                if highest + longest <= y {
                    break;
                }
                let other = &fallen[other];
                let reach = CLEARANCE * (r + other.r);
                let dx = x - (other.x[0] - place.corner[0]);
                if dx.abs() < reach {
                    let above = (reach * reach - dx * dx).sqrt();
                    y = y.max(other.x[1] - place.corner[1] + above);
                }
            }
        }
        let own = &mut strips[strip(x)];
        let [left, bottom] = place.corner;
        let height = bottom + y - bottom;
        own.push((index, own.last().map_or(height, |&(_, highest)| height.max(highest))));
        let kick = rng.random_range(-0.01..0.01);
        fallen.push(Grain { x: [left + x, bottom + y], v: [kick, 0.0], w: 0.0, r });
    }
    Packed { grains: fallen, contacts: Vec::new() }
}

/// The box in which a column is prepared: frictionless sides, and the floor of the domain below a column that
/// stands on it. As small as can be: positions are resolved the better.
fn silo(grains: &Grains, boundary: &Boundary, place: &ColumnBox, rain: &Packed) -> Boundary {
    let highest = rain.grains.iter().map(|grain| grain.x[1]).fold(0.0, f64::max);
    let stands = stands(place);
    let bottom = if stands { boundary.walls.bottom } else { 0.0 };
    Boundary {
        corner: place.corner,
        size: [place.size[0], highest + 2.0 * grains.radius_max - place.corner[1]],
        walls: Faces { bottom, ..Faces::default() },
        floor: if stands { boundary.floor } else { Floor::Flat },
        boxes: Vec::new(),
        seed: boundary.seed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each as low as all grains before it let it lie, but for the rounding of its place far from the origin.
    #[test]
    fn grains_of_the_rain_lie_on_those_below() {
        let grains = Grains::default();
        let place = ColumnBox { corner: [7.3, 2.1], size: [0.3, 0.4], loaded: true };
        let fallen = rain(&grains, &place, 1).grains;
        let lowest = |k: usize| {
            let Grain { x, r, .. } = fallen[k];
            fallen[..k].iter().fold(r, |y, other| {
                let (reach, dx) = (CLEARANCE * (r + other.r), x[0] - other.x[0]);
                let above = (reach * reach - dx * dx).sqrt();
                if dx.abs() < reach { y.max(other.x[1] - place.corner[1] + above) } else { y }
            })
        };
        for (k, grain) in fallen.iter().enumerate() {
            let height = grain.x[1] - place.corner[1];
            assert!((height - lowest(k)).abs() < 1.0e-9, "grain {k}: {height} and {}", lowest(k));
        }
    }
}
