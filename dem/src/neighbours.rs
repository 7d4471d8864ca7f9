//! Verlet list of the pairs that can touch: searched in bins of the cell or, in a thin cell, among all
//! periodic images.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::cell::{Cell, min_stretch};
use crate::disc::Disc;
use crate::real::{Image, Real};

/// Periodic image of a pair along both cell vectors.
pub type Image2 = [Image; 2];

/// A pair of discs close enough to touch before the next search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Pair<R: Real> {
    /// Index of one disc.
    pub i: u16,
    /// Index of the other disc.
    pub j: u16,
    /// Tangential spring force (N) along the contact's current tangent: positive acts on `j`
    /// counter-clockwise around `i`. In two dimensions this scalar follows rotations by itself.
    pub tangential: R,
    /// Normal dashpot coefficient `2 zeta sqrt(m_eff kn)` (kg/s).
    pub dashpot: R,
}

/// The pairs within reach, and how far discs may move before the next search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Neighbours<R: Real> {
    /// Grouped by ascending `i`; `i < j`, or `i == j` for a disc and its own image.
    pub pairs: Vec<Pair<R>>,
    /// One image per pair in a thin cell; empty when every pair is its nearest image.
    pub images: Vec<Image2>,
    /// Force of each pair's rolling spring (N), whose torque on `j` is this times the reduced radius; empty without
    /// rolling resistance.
    pub rolling: Vec<R>,
    /// Cell vectors at the last search.
    pub(crate) reference_cell: Matrix2<f64>,
    /// Reduced positions at the last search.
    pub(crate) reference: Vec<[R::Fraction; 2]>,
    /// Upper bound of the peculiar displacement of any disc since the last search, in the cell of
    /// that search (m).
    pub(crate) travel: f64,
    /// Largest distance at which discs touch, and what the list reaches beyond it (m).
    /// A skin of 0 means that there is no list yet.
    pub(crate) reach: f64,
    pub(crate) skin: f64,
    #[serde(skip)]
    pub(crate) scratch: Scratch,
}

/// Buffers of a search, kept so that searching does not allocate once warm.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    history: Vec<History>,
    bin_start: Vec<u32>,
    bin_discs: Vec<u16>,
}

/// Scratch buffers are no state.
impl PartialEq for Scratch {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Springs of a touching pair before the search.
#[derive(Clone, Copy, Debug)]
struct History {
    i: u16,
    j: u16,
    branch: Vector2<f64>,
    tangential: f64,
    rolling: f64,
}

impl<R: Real> Default for Neighbours<R> {
    fn default() -> Self {
        Self {
            pairs: Vec::new(),
            images: Vec::new(),
            rolling: Vec::new(),
            reference_cell: Matrix2::identity(),
            reference: Vec::new(),
            travel: 0.0,
            reach: 0.0,
            skin: 0.0,
            scratch: Scratch::default(),
        }
    }
}

impl<R: Real> Neighbours<R> {
    /// Image of pair `index`; `None` where the nearest image is the only one in reach.
    pub fn image(&self, index: usize) -> Option<Image2> {
        self.images.get(index).copied()
    }

    /// Pairs with their history in another precision, to be searched before their first use.
    pub(crate) fn convert<Q: Real>(&self) -> Neighbours<Q> {
        let real = |x: R| Q::from_f64(x.to_f64());
        Neighbours {
            pairs: self
                .pairs
                .iter()
                .map(|p| Pair {
                    i: p.i,
                    j: p.j,
                    tangential: real(p.tangential),
                    dashpot: real(p.dashpot),
                })
                .collect(),
            images: self.images.clone(),
            rolling: self.rolling.iter().map(|&x| real(x)).collect(),
            ..Neighbours::default()
        }
    }

    /// Whether a pair outside the list may touch now. `moved` bounds what any disc moved (m)
    /// since the last call.
    ///
    /// A pair not listed was further apart than `r_i + r_j + skin`. Peculiar displacements of at
    /// most `D` each, measured in the cell of the search, and the affine motion `F` since then
    /// bring it to no less than `s (r_i + r_j + skin - 2 D)`, with `s` the smallest stretch of `F`.
    /// That must not fall below `r_i + r_j`, for any pair up to `reach`.
    pub(crate) fn outdated(&mut self, cell: &Cell, discs: &[Disc<R>], moved: f64) -> bool {
        if self.skin == 0.0 {
            return true;
        }
        let Some(inverse) = self.reference_cell.try_inverse() else {
            return true;
        };
        let stretch = min_stretch(&(cell.h * inverse));
        // Expansion helps large pairs more than small ones: it must not be counted on.
        let allowed = 0.5 * (self.reach + self.skin - self.reach / stretch.min(1.0));
        self.travel += moved / stretch;
        if self.travel <= allowed {
            return false;
        }
        self.travel = self.displacement(discs);
        self.travel > allowed || self.travel.is_nan()
    }

    /// Largest peculiar displacement since the last search, in the cell of that search (m).
    pub(crate) fn displacement(&self, discs: &[Disc<R>]) -> f64 {
        let h = (self.reference_cell * R::UNIT).map(R::from_f64);
        let mut largest = R::default();
        for (d, reference) in discs.iter().zip(&self.reference) {
            let sx = R::nearest(reference[0], d.s[0]);
            let sy = R::nearest(reference[1], d.s[1]);
            let x = h[(0, 0)] * sx + h[(0, 1)] * sy;
            let y = h[(1, 0)] * sx + h[(1, 1)] * sy;
            largest = largest.max(x * x + y * y);
        }
        largest.sqrt().to_f64()
    }
}

/// Vector from disc `i` of a pair to the given image of disc `j` (m).
pub(crate) fn branch<R: Real>(
    cell: &Cell,
    discs: &[Disc<R>],
    pair: &Pair<R>,
    image: Option<Image2>,
) -> Vector2<f64> {
    let (a, b) = (&discs[pair.i as usize], &discs[pair.j as usize]);
    let ds = [0, 1].map(|k| match image {
        None => R::nearest(a.s[k], b.s[k]),
        Some(image) => R::image(a.s[k], b.s[k], image[k]),
    });
    cell.h * Vector2::from(ds.map(|x| x.to_f64() * R::UNIT))
}

impl<R: Real> Neighbours<R> {
    /// Lists all pairs within `r_i + r_j + skin` (m), after reducing the lattice where it has become
    /// oblique. Touching pairs keep their history. `dashpot` gives the coefficient of a pair (kg/s).
    pub(crate) fn search(
        &mut self,
        cell: &mut Cell,
        discs: &mut [Disc<R>],
        skin: f64,
        dashpot: impl Fn(&Disc<R>, &Disc<R>) -> R,
    ) {
        self.collect_history(cell, discs);
        while let Some(step) = cell.reduction() {
            for d in &mut *discs {
                let other = 1 - step.target;
                d.s[other] = R::shear(d.s[other], step.k, d.s[step.target]);
            }
            cell.reduce(step);
        }

        let r_max = discs.iter().fold(0.0, |r: f64, d| r.max(d.r.to_f64()));
        self.reach = 2.0 * r_max;
        self.skin = skin;
        self.travel = 0.0;
        self.reference_cell = cell.h;
        self.reference.clear();
        self.reference.extend(discs.iter().map(|d| d.s));
        self.pairs.clear();
        self.images.clear();

        let bins = (cell.widths() / (self.reach + skin)).map(|n| n.floor() as usize);
        // With three bins each way no pair within reach has a second image within reach.
        if bins.min() >= 3 {
            self.list_binned(cell, discs, [bins.x.min(64), bins.y.min(64)], dashpot);
        } else {
            self.list_all_images(cell, discs, dashpot);
        }
        self.restore_history(cell, discs);
    }

    fn collect_history(&mut self, cell: &Cell, discs: &[Disc<R>]) {
        let mut history = std::mem::take(&mut self.scratch.history);
        history.clear();
        history.extend(self.pairs.iter().enumerate().filter_map(|(index, pair)| {
            let tangential = pair.tangential.to_f64();
            let rolling = self.rolling.get(index).map_or(0.0, |x| x.to_f64());
            (tangential != 0.0 || rolling != 0.0).then(|| History {
                i: pair.i,
                j: pair.j,
                branch: branch(cell, discs, pair, self.image(index)),
                tangential,
                rolling,
            })
        }));
        self.scratch.history = history;
    }

    /// Gives each listed pair the springs it had. Several images of one pair are told
    /// apart by their branch vectors, which a search does not change.
    fn restore_history(&mut self, cell: &Cell, discs: &[Disc<R>]) {
        let history = std::mem::take(&mut self.scratch.history);
        if !self.rolling.is_empty() {
            self.rolling.clear();
            self.rolling.resize(self.pairs.len(), R::default());
        }
        let mut rest = history.as_slice();
        for index in 0..self.pairs.len() {
            let pair = self.pairs[index];
            let skip = rest.iter().take_while(|h| h.i < pair.i).count();
            rest = &rest[skip..];
            let old = rest.iter().take_while(|h| h.i == pair.i).filter(|h| h.j == pair.j);
            let image = self.image(index);
            for h in old {
                let same = image.is_none() || {
                    let branch = branch(cell, discs, &pair, image);
                    let near = |b: Vector2<f64>| (b - h.branch).norm() < 0.1 * b.norm();
                    // A disc and its own image are listed once, in either direction.
                    near(branch) || (pair.i == pair.j && near(-branch))
                };
                if same {
                    self.pairs[index].tangential = R::from_f64(h.tangential);
                    if let Some(rolling) = self.rolling.get_mut(index) {
                        *rolling = R::from_f64(h.rolling);
                    }
                }
            }
        }
        self.scratch.history = history;
    }

    /// Pairs from the 3 x 3 bins around each disc; nearest images only.
    fn list_binned(
        &mut self,
        cell: &Cell,
        discs: &[Disc<R>],
        [nx, ny]: [usize; 2],
        dashpot: impl Fn(&Disc<R>, &Disc<R>) -> R,
    ) {
        let Self { pairs, scratch, skin, .. } = self;
        let bin = |d: &Disc<R>| (R::bin(d.s[0], nx), R::bin(d.s[1], ny));

        // Counting sort: `bin_discs[bin_start[b]..bin_start[b + 1]]` lie in bin b, ascending.
        let start = &mut scratch.bin_start;
        start.clear();
        start.resize(nx * ny + 1, 0);
        for d in discs {
            let (bx, by) = bin(d);
            start[by * nx + bx + 1] += 1;
        }
        for b in 0..nx * ny {
            start[b + 1] += start[b];
        }
        scratch.bin_discs.resize(discs.len(), 0);
        for (i, d) in discs.iter().enumerate().rev() {
            let (bx, by) = bin(d);
            // Filled from the back: start[b + 1] walks down to the start of bin b.
            let slot = &mut start[by * nx + bx + 1];
            *slot -= 1;
            scratch.bin_discs[*slot as usize] = i as u16;
        }
        let bin_range = |b: usize| {
            let first = start[b + 1] as usize;
            let last = start.get(b + 2).map_or(discs.len(), |&s| s as usize);
            first..last
        };

        let h = (cell.h * R::UNIT).map(R::from_f64);
        let skin = R::from_f64(*skin);
        for (i, a) in discs.iter().enumerate() {
            let (bx, by) = bin(a);
            for dy in [ny - 1, 0, 1] {
                for dx in [nx - 1, 0, 1] {
                    let b = (by + dy) % ny * nx + (bx + dx) % nx;
                    for &j in &scratch.bin_discs[bin_range(b)] {
                        if (j as usize) <= i {
                            continue;
                        }
                        let c = &discs[j as usize];
                        let sx = R::nearest(a.s[0], c.s[0]);
                        let sy = R::nearest(a.s[1], c.s[1]);
                        let x = h[(0, 0)] * sx + h[(0, 1)] * sy;
                        let y = h[(1, 0)] * sx + h[(1, 1)] * sy;
                        let range = a.r + c.r + skin;
                        if x * x + y * y < range * range {
                            pairs.push(Pair {
                                i: i as u16,
                                j,
                                tangential: R::default(),
                                dashpot: dashpot(a, c),
                            });
                        }
                    }
                }
            }
        }
    }

    /// Every image of every pair, a disc and its own images included: right for any cell.
    fn list_all_images(
        &mut self,
        cell: &Cell,
        discs: &[Disc<R>],
        dashpot: impl Fn(&Disc<R>, &Disc<R>) -> R,
    ) {
        let widths = cell.widths();
        let Self { pairs, images, skin, .. } = self;
        for (i, a) in discs.iter().enumerate() {
            for (j, c) in discs.iter().enumerate().skip(i) {
                let range = a.r.to_f64() + c.r.to_f64() + *skin;
                let nearest = Vector2::new(
                    R::nearest(a.s[0], c.s[0]).to_f64() * R::UNIT,
                    R::nearest(a.s[1], c.s[1]).to_f64() * R::UNIT,
                );
                // |s_x| > range / width_x puts the branch out of range whatever s_y is.
                let most = widths.map(|w| range / w);
                let shifts = |k: usize| {
                    let first = (-most[k] - nearest[k]).ceil() as i32;
                    let last = (most[k] - nearest[k]).floor() as i32;
                    first..=last
                };
                for ky in shifts(1) {
                    for kx in shifts(0) {
                        // Of a disc's own images k and -k are one contact, and 0 is none.
                        if i == j && (ky, kx) <= (0, 0) {
                            continue;
                        }
                        let s = nearest + Vector2::new(f64::from(kx), f64::from(ky));
                        if (cell.h * s).norm() < range {
                            pairs.push(Pair {
                                i: i as u16,
                                j: j as u16,
                                tangential: R::default(),
                                dashpot: dashpot(a, c),
                            });
                            images.push([Image::of(nearest.x, s.x), Image::of(nearest.y, s.y)]);
                        }
                    }
                }
            }
        }
    }
}
