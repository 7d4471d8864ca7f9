//! Points sorted by the cell of nodes they see.
//!
//! Sums over points are done bin by bin and then node by node in a fixed order: the same bits for
//! any number of threads, without atomics.

use std::ops::Range;

use crate::stencil::Stencil;

/// Marks a cell without points.
const EMPTY: u32 = u32::MAX;

/// Groups of points with the same lowest, leftmost node.
#[derive(Default)]
pub(crate) struct Bins {
    /// Points, bin after bin, ascending within a bin.
    order: Vec<u32>,
    /// Where each bin begins in `order`, and the end.
    start: Vec<u32>,
    /// The bin of each node, or [`EMPTY`].
    bin: Vec<u32>,
    /// Scratch: points per node, then the place of the next one.
    next: Vec<u32>,
    /// For each row of nodes the columns that some point sees. Nodes outside hold old data and
    /// are never read.
    spans: Vec<Range<usize>>,
}

impl Bins {
    /// Sorts points into bins (counting sort, stable).
    pub fn sort(&mut self, stencils: &[Stencil], columns: usize, rows: usize, width: usize) {
        self.next.clear();
        self.next.resize(columns * rows, 0);
        for stencil in stencils {
            self.next[stencil.node] += 1;
        }

        self.bin.clear();
        self.bin.resize(columns * rows, EMPTY);
        self.spans.clear();
        self.spans.resize(rows, columns..0);
        self.start.clear();
        self.start.reserve(stencils.len() + 1);
        let mut begin = 0;
        for (node, next) in self.next.iter_mut().enumerate() {
            if *next == 0 {
                continue;
            }
            self.bin[node] = self.start.len() as u32;
            self.start.push(begin);
            begin += *next;
            *next = begin - *next;
            let (row, column) = (node / columns, node % columns);
            for span in &mut self.spans[row..row + width] {
                span.start = span.start.min(column);
                span.end = span.end.max(column + width);
            }
        }
        self.start.push(begin);
        for span in &mut self.spans {
            span.start = span.start.min(span.end);
        }

        self.order.resize(stencils.len(), 0);
        for (point, stencil) in stencils.iter().enumerate() {
            let next = &mut self.next[stencil.node];
            self.order[*next as usize] = point as u32;
            *next += 1;
        }
    }

    /// Number of bins; all hold at least one point.
    pub fn len(&self) -> usize {
        self.start.len() - 1
    }

    /// Points of a bin.
    pub fn points(&self, bin: usize) -> &[u32] {
        &self.order[self.start[bin] as usize..self.start[bin + 1] as usize]
    }

    /// The bin whose lowest, leftmost node is `node`.
    pub fn at(&self, node: usize) -> Option<usize> {
        let bin = self.bin[node];
        (bin != EMPTY).then_some(bin as usize)
    }

    /// Points whose `width` x `width` nodes include this one, in a fixed order.
    pub fn seen_by(
        &self,
        row: usize,
        column: usize,
        columns: usize,
        width: usize,
    ) -> impl Iterator<Item = usize> + '_ {
        let near = move |k: usize| k.saturating_sub(width - 1)..=k;
        let nodes = near(row).flat_map(move |r| near(column).map(move |c| r * columns + c));
        let bins = nodes.filter_map(|node| self.at(node));
        bins.flat_map(|bin| self.points(bin)).map(|&p| p as usize)
    }

    /// Columns of nodes in use, by row.
    pub fn spans(&self) -> &[Range<usize>] {
        &self.spans
    }
}
