//! The history of contacts while discs and lists are put in a new order.

use std::collections::HashMap;

use super::pairs::History;
use super::tile::Tile;
use crate::real::Real;

/// Histories of touching pairs by the identities of their discs.
#[derive(Debug, Default)]
pub(crate) struct ContactMemory<R: Real> {
    /// Entries of disc `i` with discs of larger identity: `start[i]..start[i + 1]`.
    start: Vec<u32>,
    partner: Vec<u32>,
    history: Vec<History<R>>,
    bodies: HashMap<(u32, u16), History<R>>,
}

impl<R: Real> ContactMemory<R> {
    /// The contacts of tiles whose discs have these identities.
    pub(super) fn of_tiles(tiles: &[Tile<R>], ids: &[u32]) -> Self {
        let id = |k: u32| ids[k as usize];
        // A pair across a border is in both tiles.
        let outer = tiles.iter().flat_map(|tile| tile.outer.iter().filter(|pair| pair.i < pair.j));
        let pairs = tiles.iter().flat_map(|tile| tile.inner.iter()).chain(outer);
        let pairs = pairs.map(|pair| (id(pair.i), id(pair.j), pair.contact));
        let bodies = tiles.iter().flat_map(|tile| &tile.bodies);
        let bodies = bodies.map(|pair| (id(pair.disc), pair.body, pair.contact));
        Self::new(ids.len(), &pairs.collect::<Vec<_>>(), bodies)
    }

    /// Contacts of pairs of discs, each seen from its first one, and of discs with bodies.
    pub fn new(
        discs: usize,
        pairs: &[(u32, u32, History<R>)],
        bodies: impl Iterator<Item = (u32, u16, History<R>)>,
    ) -> Self {
        let touching = || pairs.iter().filter(|(_, _, contact)| *contact != History::default());
        let mut start = vec![0; discs + 1];
        for &(a, b, _) in touching() {
            start[a.min(b) as usize + 1] += 1;
        }
        for k in 1..start.len() {
            start[k] += start[k - 1];
        }
        let mut next = start.clone();
        let count = start[discs] as usize;
        let (mut partner, mut history) = (vec![0; count], vec![History::default(); count]);
        for &(a, b, contact) in touching() {
            let place = &mut next[a.min(b) as usize];
            partner[*place as usize] = a.max(b);
            history[*place as usize] = if a < b { contact } else { contact.reversed() };
            *place += 1;
        }
        let bodies = bodies
            .filter(|(_, _, contact)| *contact != History::default())
            .map(|(disc, body, contact)| ((disc, body), contact))
            .collect();
        Self { start, partner, history, bodies }
    }

    /// History of two discs, seen from the first one.
    pub fn of_pair(&self, a: u32, b: u32) -> History<R> {
        let first = a.min(b) as usize;
        let range = self.start[first] as usize..self.start[first + 1] as usize;
        let found = self.partner[range.clone()].iter().position(|&p| p == a.max(b));
        let history = found.map_or_else(History::default, |k| self.history[range.start + k]);
        if a < b { history } else { history.reversed() }
    }

    /// History of a disc and a body.
    pub fn of_body(&self, disc: u32, body: u16) -> History<R> {
        self.bodies.get(&(disc, body)).copied().unwrap_or_default()
    }

    /// All pairs: the smaller identity, the larger one, and their history.
    pub fn contacts(&self) -> impl Iterator<Item = (u32, u32, History<R>)> {
        (0..self.start.len().saturating_sub(1)).flat_map(move |a| {
            let range = self.start[a] as usize..self.start[a + 1] as usize;
            range.map(move |k| (a as u32, self.partner[k], self.history[k]))
        })
    }

    /// All contacts of discs with bodies, in the order of discs.
    pub fn body_contacts(&self) -> Vec<(u32, u16, History<R>)> {
        let mut contacts: Vec<_> = self.bodies.iter().map(|(&(d, b), &h)| (d, b, h)).collect();
        contacts.sort_unstable_by_key(|&(disc, body, _)| (disc, body));
        contacts
    }
}
