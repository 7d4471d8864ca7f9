//! Search for neighbours: discs are put in the order of tiles and bins, and every tile lists the pairs
//! within reach.

use rayon::prelude::*;

use super::boundary::RigidBox;
use super::coordinates::Region;
use super::memory::ContactMemory;
use super::tile::{BodyPair, Pair, Tile};
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

/// Discs in the order of bins, each with its identity.
pub(super) fn sort<R: Real>(discs: &mut Vec<Disc<R>>, ids: &mut Vec<u32>, bins: &Bins) {
    let mut order: Vec<([u32; 4], u32, u32)> = discs
        .par_iter()
        .zip(&*ids)
        .enumerate()
        .map(|(index, (disc, &id))| (bins.key(disc), id, index as u32))
        .collect();
    order.par_sort_unstable_by_key(|&(key, id, _)| (key, id));
    *discs = order.par_iter().map(|&(_, _, index)| discs[index as usize]).collect();
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

/// What a search works with.
pub(super) struct Search<'a, R: Real> {
    pub law: &'a ContactLaw<R>,
    pub bins: Bins,
    /// Pairs are listed up to this distance beyond touch (m).
    pub skin: f64,
    pub discs: &'a [Disc<R>],
    pub ids: &'a [u32],
    /// Walls and boxes where they are now.
    pub bodies: &'a [RigidBox],
    pub time: f64,
    pub memory: &'a ContactMemory<R>,
}

impl<R: Real> Search<'_, R> {
    /// Tiles with all pairs within reach, whose contacts continue.
    pub fn tiles(&self) -> Vec<Tile<R>> {
        let empty: Vec<Tile<R>> = divide(self.discs, &self.bins);
        let listed = empty.par_iter().map(|tile| {
            let mut tile = tile.clone();
            self.list(&mut tile, &empty);
            tile
        });
        listed.collect()
    }

    fn list(&self, tile: &mut Tile<R>, tiles: &[Tile<R>]) {
        let near = Near::around(tile, tiles, self.discs, &self.bins);
        let unit = R::from_f64(self.bins.region.unit::<R>());
        let skin = R::from_f64(self.skin);
        let own = tile.len();
        // Place of each nearby disc in the tile; ghosts get one when they are first needed.
        let mut local: Vec<u16> = (0..near.discs.len()).map(|k| k as u16).collect();
        local[own..].fill(u16::MAX);
        for (i, &index) in near.discs[..own].iter().enumerate() {
            let a = &self.discs[index as usize];
            for &candidate in near.around_bin(near.bin[i]) {
                let j = candidate as usize;
                let other = near.discs[j];
                // Both tiles list a pair across their border, a tile an own pair once.
                if j < own && j <= i {
                    continue;
                }
                let b = &self.discs[other as usize];
                let x = unit * R::nearest(a.s[0], b.s[0]);
                let y = unit * R::nearest(a.s[1], b.s[1]);
                let range = a.r + b.r + skin;
                let fixed = a.inv_mass == R::default() && b.inv_mass == R::default();
                if x * x + y * y >= range * range || fixed {
                    continue;
                }
                if local[j] == u16::MAX {
                    local[j] = (own + tile.ghosts.len()) as u16;
                    tile.ghosts.push(other);
                }
                let (i, j) =
                    if index < other { (local[i], local[j]) } else { (local[j], local[i]) };
                let (id, other_id) = (self.ids[index as usize], self.ids[other as usize]);
                let contact = self.memory.of_pair(id, other_id);
                let pair = Pair { i, j, contact, dashpot: self.law.dashpot(a, b) };
                if usize::from(i.max(j)) < own {
                    tile.inner.push(pair);
                } else {
                    tile.outer.push(pair);
                }
            }
        }
        self.list_bodies(tile);
    }

    fn list_bodies(&self, tile: &mut Tile<R>) {
        let own = tile.first as usize..tile.end as usize;
        for (k, (disc, &id)) in self.discs[own.clone()].iter().zip(&self.ids[own]).enumerate() {
            if disc.inv_mass == R::default() {
                continue;
            }
            let x = self.bins.region.decode::<R>(disc.s);
            let range = disc.r.to_f64() + self.skin;
            for (body, rigid) in self.bodies.iter().enumerate() {
                let [dx, dy] = rigid.branch(x, self.time);
                if dx * dx + dy * dy < range * range {
                    tile.bodies.push(BodyPair {
                        disc: k as u16,
                        body: body as u16,
                        contact: self.memory.of_body(id, body as u16),
                        dashpot: self.law.body_dashpot(disc),
                    });
                }
            }
        }
    }
}

/// Discs in and around a tile, by bins.
struct Near {
    /// Own discs, then those of the bins around the tile.
    discs: Vec<u32>,
    /// Bin of each, in the tile with a margin of one bin.
    bin: Vec<u32>,
    /// Bins in a row of them.
    row: u32,
    start: Vec<u32>,
    sorted: Vec<u16>,
}

impl Near {
    fn around<R: Real>(tile: &Tile<R>, tiles: &[Tile<R>], discs: &[Disc<R>], bins: &Bins) -> Self {
        let row = bins.per_tile + 2;
        // Bin of a disc, counted from one left of and below the tile.
        let local = |disc: &Disc<R>| {
            let [bx, by] = bins.of(disc);
            let [tx, ty] = tile.place.map(|place| place * bins.per_tile);
            let (x, y) = ((bx + 1).wrapping_sub(tx), (by + 1).wrapping_sub(ty));
            (x < row && y < row).then(|| y * row + x)
        };
        let mut near =
            Self { discs: Vec::new(), bin: Vec::new(), row, start: Vec::new(), sorted: Vec::new() };
        let mut add = |from: &Tile<R>| {
            for index in from.first..from.end {
                if let Some(bin) = local(&discs[index as usize]) {
                    near.discs.push(index);
                    near.bin.push(bin);
                }
            }
        };
        add(tile);
        let [x, y] = tile.place;
        for ty in y.saturating_sub(1)..=y + 1 {
            let first =
                tiles.partition_point(|t| (t.place[1], t.place[0]) < (ty, x.saturating_sub(1)));
            let row = tiles[first..].iter().take_while(|t| t.place[1] == ty && t.place[0] <= x + 1);
            row.filter(|t| t.place != tile.place).for_each(&mut add);
        }
        near.sort();
        near
    }

    /// Counting sort: `sorted[start[b]..start[b + 1]]` are the discs of bin b.
    fn sort(&mut self) {
        self.start = vec![0; (self.row * self.row) as usize + 1];
        for &bin in &self.bin {
            self.start[bin as usize + 1] += 1;
        }
        for b in 1..self.start.len() {
            self.start[b] += self.start[b - 1];
        }
        let mut next = self.start.clone();
        self.sorted = vec![0; self.discs.len()];
        for (k, &bin) in self.bin.iter().enumerate() {
            self.sorted[next[bin as usize] as usize] = k as u16;
            next[bin as usize] += 1;
        }
    }

    /// The discs of a bin and the eight around it, row by row.
    fn around_bin(&self, bin: u32) -> impl Iterator<Item = &u16> {
        [bin - self.row, bin, bin + self.row].into_iter().flat_map(|middle| {
            let range = self.start[middle as usize - 1]..self.start[middle as usize + 2];
            &self.sorted[range.start as usize..range.end as usize]
        })
    }
}
