//! Search for neighbours: discs are put in the order of tiles and bins, and every tile lists the pairs
//! within reach. As discs move, tiles list their pairs again, each when its discs demand it, until a disc
//! has moved by a bin and all are sorted again.

use rayon::prelude::*;

use super::boundary::RigidBox;
use super::coordinates::Region;
use super::memory::ContactMemory;
use super::pairs::{BodyPair, History, Pair};
use super::sleep::Rest;
use super::tile::Tile;
use crate::contact::ContactLaw;
use crate::disc::Disc;
use crate::grains::Grains;
use crate::real::Real;

/// Discs of a full tile: few enough to stay in a core's cache, many enough that few pairs cross borders.
const TILE_DISCS: f64 = 600.0;

/// Bins and tiles of a region.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bins {
    region: Region,
    /// Side of a bin (m): the largest distance of a listed pair.
    side: f64,
    /// Bins along a side of a tile.
    per_tile: u32,
}

impl Bins {
    /// Bins for pairs within touch and `skin` (m).
    pub fn new(grains: &Grains, region: Region, skin: f64) -> Self {
        let side = 2.0 * grains.radius_max + skin;
        let mean = 0.5 * grains.mean_diameter();
        let in_bin = side * side / (std::f64::consts::PI * mean * mean);
        let per_tile = (TILE_DISCS / in_bin).sqrt().ceil().max(1.0) as u32;
        Self { region, side, per_tile }
    }

    /// How far a disc may move between two sorts (m): less than a bin, as places are rounded.
    pub fn drift(&self) -> f64 {
        0.99 * self.side
    }

    /// Column and row of the bin of a disc.
    fn of<R: Real>(&self, disc: &Disc<R>) -> [u32; 2] {
        disc.s.map(|s| (R::fraction_to_f64(s) * (self.region.side / self.side)) as u32)
    }

    /// Tile by tile, row by row, and bin by bin within a tile.
    fn key<R: Real>(&self, disc: &Disc<R>) -> [u32; 4] {
        let [bx, by] = self.of(disc);
        let n = self.per_tile;
        [by / n, bx / n, by % n, bx % n]
    }
}

/// Discs in the order of bins, each with its identity and, where grains sleep, its rest.
pub(super) fn sort<R: Real>(
    discs: &mut Vec<Disc<R>>,
    ids: &mut Vec<u32>,
    rest: &mut Vec<Rest<R>>,
    bins: &Bins,
) {
    let mut order: Vec<([u32; 4], u32, u32)> = discs
        .par_iter()
        .zip(&*ids)
        .enumerate()
        .map(|(index, (disc, &id))| (bins.key(disc), id, index as u32))
        .collect();
    order.par_sort_unstable_by_key(|&(key, id, _)| (key, id));
    *discs = order.par_iter().map(|&(_, _, index)| discs[index as usize]).collect();
    if !rest.is_empty() {
        *rest = order.par_iter().map(|&(_, _, index)| rest[index as usize]).collect();
    }
    *ids = order.iter().map(|&(_, id, _)| id).collect();
}

/// Divides sorted discs into tiles, without pairs.
fn divide<R: Real>(discs: &[Disc<R>], bins: &Bins) -> Vec<Tile<R>> {
    let place = |disc: &Disc<R>| bins.of(disc).map(|b| b / bins.per_tile);
    let mut tiles: Vec<Tile<R>> = Vec::new();
    for (index, disc) in discs.iter().enumerate() {
        let (index, place) = (index as u32, place(disc));
        match tiles.last_mut() {
            Some(tile) if tile.place == place => tile.end = index + 1,
            _ => tiles.push(Tile { place, first: index, end: index + 1, ..Tile::default() }),
        }
    }
    tiles
}

/// Places in the list of this tile and those around it, row by row.
fn around<R: Real>(tile: &Tile<R>, tiles: &[Tile<R>]) -> Vec<u32> {
    let [x, y] = tile.place;
    let mut around = Vec::with_capacity(9);
    for ty in y.saturating_sub(1)..=y + 1 {
        let left = (ty, x.saturating_sub(1));
        let first = tiles.partition_point(|t| (t.place[1], t.place[0]) < left);
        let row = tiles[first..].iter().take_while(|t| t.place[1] == ty && t.place[0] <= x + 1);
        around.extend((first as u32..).zip(row).map(|(k, _)| k));
    }
    around
}

/// What a search works with.
pub(super) struct Search<'a, R: Real> {
    pub law: &'a ContactLaw<R>,
    pub bins: Bins,
    /// Pairs are listed up to this distance beyond touch (m).
    pub skin: f64,
    pub discs: &'a [Disc<R>],
    /// Walls and boxes where they are now.
    pub bodies: &'a [RigidBox],
    pub time: f64,
}

impl<R: Real> Search<'_, R> {
    /// Tiles of sorted discs with these identities, with all pairs within reach, whose contacts continue.
    pub fn tiles(&self, ids: &[u32], memory: &ContactMemory<R>) -> Vec<Tile<R>> {
        let empty: Vec<Tile<R>> = divide(self.discs, &self.bins);
        let id = |k: u32| ids[k as usize];
        let listed = empty.par_iter().map(|tile| {
            let mut tile = tile.clone();
            tile.around = around(&tile, &empty);
            tile.halo = self.halo(&tile, &empty);
            self.list(&mut tile, |i, j| memory.of_pair(id(i), id(j)));
            self.list_bodies(&mut tile, |disc, body| memory.of_body(id(disc), body));
            tile
        });
        listed.collect()
    }

    /// Lists the pairs of a tile again.
    pub fn renew(&self, tile: &mut Tile<R>) {
        let touching = |pair: &Pair<R>| pair.contact != History::default();
        let pairs = tile.inner.iter().chain(tile.outer.iter());
        let mut pairs: Vec<Pair<R>> = pairs.filter(touching).collect();
        tile.inner.clear();
        tile.outer.clear();
        pairs.sort_by_key(|pair| pair.i);
        // Pairs are asked for in the order of their first disc.
        let mut next = 0;
        self.list(tile, |i, j| {
            next += pairs[next..].iter().take_while(|pair| pair.i < i).count();
            let of_disc = pairs[next..].iter().take_while(|pair| pair.i == i);
            of_disc.copied().find(|pair| pair.j == j).unwrap_or_default().contact
        });
        let bodies = std::mem::take(&mut tile.bodies);
        self.list_bodies(tile, |disc, body| {
            let found = bodies.binary_search_by_key(&(disc, body), |pair| (pair.disc, pair.body));
            found.map_or_else(|_| History::default(), |k| bodies[k].contact)
        });
    }

    /// Discs of the tiles around that can come within reach of one of a tile before the next sort: both
    /// move by less than a bin, and pairs reach one bin far.
    fn halo(&self, tile: &Tile<R>, tiles: &[Tile<R>]) -> Vec<u32> {
        let frame = Frame::new(tile, &self.bins, 3);
        let others = tile.around.iter().map(|&k| &tiles[k as usize]);
        let discs = others.filter(|t| t.place != tile.place).flat_map(|t| t.first..t.end);
        discs.filter(|&k| frame.bin(&self.discs[k as usize]).is_some()).collect()
    }

    /// Lists pairs of discs, whose contacts continue from `memory`.
    fn list(&self, tile: &mut Tile<R>, mut memory: impl FnMut(u32, u32) -> History<R>) {
        let near = Near::new(tile, self.discs, &self.bins);
        let unit = R::from_f64(self.bins.region.unit::<R>());
        let skin = R::from_f64(self.skin);
        let mut within = Vec::new();
        for (i, bin) in (tile.first..tile.end).zip(near.own_bins(self.discs)) {
            let a = &self.discs[i as usize];
            near.within(a, skin, unit, bin, &mut within);
            for &j in &within {
                // Both tiles list a pair across their border, a tile an own pair once.
                let inner = (tile.first..tile.end).contains(&j);
                let b = &self.discs[j as usize];
                let fixed = a.inv_mass == R::default() && b.inv_mass == R::default();
                if inner && j <= i || fixed {
                    continue;
                }
                let pair = Pair { i, j, contact: memory(i, j), dashpot: self.law.dashpot(a, b) };
                let pairs = if inner { &mut tile.inner } else { &mut tile.outer };
                pairs.push(pair, a.r + b.r, self.law.resists_rolling());
            }
        }
        tile.reference.clear();
        let positions = (tile.first..tile.end).chain(tile.halo.iter().copied());
        tile.reference.extend(positions.map(|k| self.discs[k as usize].s));
        tile.listed = self.time;
        tile.travel = 0.0;
    }

    /// Lists pairs of discs and bodies, whose contacts continue from `memory`.
    fn list_bodies(&self, tile: &mut Tile<R>, memory: impl Fn(u32, u16) -> History<R>) {
        for k in tile.first..tile.end {
            let disc = &self.discs[k as usize];
            if disc.inv_mass == R::default() {
                continue;
            }
            let x = self.bins.region.decode::<R>(disc.s);
            let range = disc.r.to_f64() + self.skin;
            for (body, rigid) in self.bodies.iter().enumerate() {
                let [dx, dy] = rigid.branch(x, self.time);
                if dx * dx + dy * dy < range * range {
                    let body = body as u16;
                    let (contact, dashpot) = (memory(k, body), self.law.body_dashpot(disc));
                    tile.bodies.push(BodyPair { disc: k, body, contact, dashpot });
                }
            }
        }
    }
}

/// The bins of a tile, with some more around it.
struct Frame<'a> {
    bins: &'a Bins,
    /// Lower left bin of the tile.
    corner: [u32; 2],
    margin: u32,
    /// Bins along a side.
    side: u32,
}

impl<'a> Frame<'a> {
    fn new<R: Real>(tile: &Tile<R>, bins: &'a Bins, margin: u32) -> Self {
        let corner = tile.place.map(|place| place * bins.per_tile);
        Self { bins, corner, margin, side: bins.per_tile + 2 * margin }
    }

    /// Bin of a disc, row by row, if it is one of these.
    fn bin<R: Real>(&self, disc: &Disc<R>) -> Option<u32> {
        let bin = self.bins.of(disc);
        let [x, y] = [0, 1].map(|k| (bin[k] + self.margin).wrapping_sub(self.corner[k]));
        (x < self.side && y < self.side).then_some(y * self.side + x)
    }
}

/// Discs in and around a tile, by bins.
struct Near<'a, R: Real> {
    frame: Frame<'a>,
    own: std::ops::Range<u32>,
    /// `sorted[start[b]..start[b + 1]]` are the discs of bin b.
    start: Vec<u32>,
    sorted: Vec<Neighbour<R>>,
}

/// What the search reads of a disc.
#[derive(Clone, Copy, Default)]
struct Neighbour<R: Real> {
    s: [R::Fraction; 2],
    r: R,
    /// Place in the assembly.
    place: u32,
}

impl<'a, R: Real> Near<'a, R> {
    fn new(tile: &Tile<R>, discs: &[Disc<R>], bins: &'a Bins) -> Self {
        // Own discs have moved by less than a bin since they were sorted into the tile.
        let frame = Frame::new(tile, bins, 2);
        let binned: Vec<(u32, u32)> =
            tile.nearby().filter_map(|k| Some((k, frame.bin(&discs[k as usize])?))).collect();
        let mut start = vec![0; (frame.side * frame.side) as usize + 1];
        for &(_, bin) in &binned {
            start[bin as usize + 1] += 1;
        }
        for b in 1..start.len() {
            start[b] += start[b - 1];
        }
        let mut next = start.clone();
        let mut sorted = vec![Neighbour::default(); binned.len()];
        for &(place, bin) in &binned {
            let Disc { s, r, .. } = discs[place as usize];
            let free = &mut next[bin as usize];
            sorted[*free as usize] = Neighbour { s, r, place };
            *free += 1;
        }
        Self { frame, own: tile.first..tile.end, start, sorted }
    }

    /// Column and row in the frame of each own disc.
    fn own_bins(&self, discs: &[Disc<R>]) -> impl Iterator<Item = u32> {
        let own = &discs[self.own.start as usize..self.own.end as usize];
        // An own disc elsewhere has a velocity beyond all measure, which ends the run.
        own.iter().map(|disc| self.frame.bin(disc).unwrap_or(self.frame.side + 1))
    }

    /// Lists the places of the discs in a bin and the eight around it that a disc can touch across `skin` (m),
    /// row by row, and its own; `unit` is that of [`Real::Fraction`] (m).
    fn within(&self, disc: &Disc<R>, skin: R, unit: R, bin: u32, places: &mut Vec<u32>) {
        let row = self.frame.side;
        let mut count = 0;
        for middle in [bin - row, bin, bin + row] {
            let range = self.start[middle as usize - 1]..self.start[middle as usize + 2];
            let others = &self.sorted[range.start as usize..range.end as usize];
            // Without branching; the entry after the last one is written speculatively.
            places.resize(count + others.len() + 1, 0);
            for other in others {
                let x = unit * R::nearest(disc.s[0], other.s[0]);
                let y = unit * R::nearest(disc.s[1], other.s[1]);
                let range = disc.r + other.r + skin;
                places[count] = other.place;
                count += usize::from(x * x + y * y < range * range);
            }
        }
        places.truncate(count);
    }
}
