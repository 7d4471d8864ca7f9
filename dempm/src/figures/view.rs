//! The window of space that a picture shows.

use super::undrawn::is_drawn;
use crate::trajectory::Header;

/// A rectangle in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct View {
    pub x: [f64; 2],
    pub y: [f64; 2],
}

impl View {
    /// A view of nothing, to be grown.
    pub(super) const EMPTY: Self =
        Self { x: [f64::INFINITY, f64::NEG_INFINITY], y: [f64::INFINITY, f64::NEG_INFINITY] };

    /// Grows the view to where the points of a frame are.
    pub(super) fn include(&mut self, position: &[[f64; 2]]) {
        for &[x, y] in position.iter().filter(|x| is_drawn(x)) {
            self.x = [self.x[0].min(x), self.x[1].max(x)];
            self.y = [self.y[0].min(y), self.y[1].max(y)];
        }
    }

    /// The view with a margin, cut a little outside the domain, so that its walls show.
    pub(super) fn framed(self, header: &Header) -> Self {
        let extent = (self.x[1] - self.x[0]).max(self.y[1] - self.y[0]).max(header.point_spacing);
        // Room for half a point, which is drawn about its position.
        let half = 0.55 * header.point_spacing;
        let (margin, wall) = (half.max(0.05 * extent), half.max(0.012 * extent));
        let cut = |range: [f64; 2], size: f64| {
            let inside = |place: f64| size <= 0.0 || (-wall..=size + wall).contains(&place);
            let (mut low, mut high) = (range[0] - margin, range[1] + margin);
            // Material beyond the domain is worth seeing, empty space there is not.
            if !inside(low) && inside(range[0]) {
                low = -wall;
            }
            if !inside(high) && inside(range[1]) {
                high = size + wall;
            }
            if low.is_finite() && high > low { [low, high] } else { [0.0, size.max(1.0)] }
        };
        let view = Self { x: cut(self.x, header.domain[0]), y: cut(self.y, header.domain[1]) };
        view.no_thinner_than(0.12)
    }

    /// Room above a shallow layer, so that its picture is no line; `least` is height over width.
    fn no_thinner_than(mut self, least: f64) -> Self {
        let short = least * self.width() - self.height();
        self.y[1] += short.max(0.0);
        let short = least * self.height() - self.width();
        self.x[1] += short.max(0.0);
        self
    }

    /// The part of a box (x min, y min, x max, y max) in the view, if there is one.
    pub(super) fn clip_box(&self, [x0, y0, x1, y1]: [f64; 4]) -> Option<[[f64; 2]; 2]> {
        let low = [x0.max(self.x[0]), y0.max(self.y[0])];
        let high = [x1.min(self.x[1]), y1.min(self.y[1])];
        // Comparisons with NaN are false: absent boxes are not drawn.
        let inside = x0 <= x1 && y0 <= y1 && low[0] < high[0] && low[1] < high[1];
        inside.then_some([low, high])
    }

    /// The part of a segment (x1, y1, x2, y2) in the view, if there is one (Liang and Barsky).
    pub(super) fn clip_segment(&self, [x1, y1, x2, y2]: [f64; 4]) -> Option<[[f64; 2]; 2]> {
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for (start, step, [low, high]) in [(x1, x2 - x1, self.x), (y1, y2 - y1, self.y)] {
            if step == 0.0 {
                if !(low..=high).contains(&start) {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low - start) / step, (high - start) / step);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        let at = |part: f64| [x1 + part * (x2 - x1), y1 + part * (y2 - y1)];
        let ends = [at(enter), at(leave)];
        (enter < leave && ends.iter().flatten().all(|place| place.is_finite())).then_some(ends)
    }

    pub(super) fn width(&self) -> f64 {
        self.x[1] - self.x[0]
    }

    pub(super) fn height(&self) -> f64 {
        self.y[1] - self.y[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(positions: &[[f64; 2]]) -> View {
        let header = Header { domain: [10.0, 4.0], point_spacing: 0.1, ..Header::default() };
        let mut view = View::EMPTY;
        view.include(positions);
        view.framed(&header)
    }

    #[test]
    fn it_follows_the_material_but_stops_at_the_domain() {
        let column = view(&[[0.05, 0.05], [3.0, 2.0]]);
        assert!(column.x[0] > -0.11 && column.x[1] > 3.1 && column.x[1] < 3.3, "{column:?}");
        let escaped = view(&[[0.05, 0.05], [12.0, 2.0]]);
        assert!(escaped.x[1] > 12.0, "{escaped:?}");
    }

    #[test]
    fn things_are_cut_at_the_view() {
        let view = View { x: [0.0, 2.0], y: [0.0, 1.0] };
        assert_eq!(view.clip_segment([-1.0, 0.5, 3.0, 0.5]), Some([[0.0, 0.5], [2.0, 0.5]]));
        assert_eq!(view.clip_segment([1.0, -1.0, 1.0, 0.5]), Some([[1.0, 0.0], [1.0, 0.5]]));
        assert_eq!(view.clip_segment([-1.0, 2.0, 3.0, 2.0]), None);
        assert_eq!(view.clip_segment([f64::NAN; 4]), None);
        assert_eq!(view.clip_box([1.0, 0.5, 9.0, 9.0]), Some([[1.0, 0.5], [2.0, 1.0]]));
        assert_eq!(view.clip_box([f64::NAN; 4]), None);
        assert_eq!(view.clip_box([3.0, 0.0, 4.0, 1.0]), None);
    }

    #[test]
    fn degenerate_material_has_a_view() {
        for positions in [&[][..], &[[f64::NAN; 2]], &[[1.0, 1.0]], &[[0.0, 0.5], [9.0, 0.5]]] {
            let view = view(positions);
            assert!(view.width() > 0.0 && view.height() > 0.0, "{view:?}");
            assert!(view.height() >= 0.119 * view.width(), "{view:?}");
        }
    }
}
