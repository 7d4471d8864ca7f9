//! Profile of a prepared column over its height.

use nalgebra::Matrix2;

use super::packed::GrainState;
use super::prepare::ColumnBox;

/// Means over a horizontal layer of a column.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Layer {
    /// Height of its middle above the column's base (m).
    pub height: f64,
    /// Area of grains, with parts of grains, over the area of the layer.
    pub solid_fraction: f64,
    /// Contacts of the grains whose centres lie in the layer, each.
    pub coordination: f64,
    /// Horizontal normal stress (Pa), compression positive.
    pub horizontal_stress: f64,
    /// Vertical normal stress (Pa), compression positive.
    pub vertical_stress: f64,
}

impl Layer {
    /// Earth pressure coefficient $K_0 = \sigma_{xx} / \sigma_{yy}$; NaN without stress.
    pub fn k0(&self) -> f64 {
        self.horizontal_stress / self.vertical_stress
    }
}

/// Divides a column into layers of equal height, from its base to its top, and averages its grains over
/// each. Grains are `thickness` (m) long. Stress is that of Love (1927) and Weber (1966), without a kinetic
/// part.
pub fn profile(
    states: &[GrainState],
    place: &ColumnBox,
    thickness: f64,
    layers: usize,
) -> Vec<Layer> {
    let [width, height] = place.size;
    let step = height / layers as f64;
    let area = width * step;
    (0..layers)
        .map(|k| {
            let bottom = place.corner[1] + k as f64 * step;
            let top = bottom + step;
            let covered: f64 =
                states.iter().map(|grain| area_below(grain, top) - area_below(grain, bottom)).sum();
            let inside = |grain: &&GrainState| (bottom..top).contains(&grain.x[1]);
            let (mut contacts, mut count) = (0, 0);
            let mut virial = Matrix2::zeros();
            for grain in states.iter().filter(inside) {
                contacts += grain.contacts;
                count += 1;
                virial += grain.virial;
            }
            let stress: Matrix2<f64> = virial / (area * thickness);
            Layer {
                height: (k as f64 + 0.5) * step,
                solid_fraction: covered / area,
                coordination: f64::from(contacts) / f64::from(count.max(1)),
                horizontal_stress: stress[(0, 0)],
                vertical_stress: stress[(1, 1)],
            }
        })
        .collect()
}

/// Area of the part of a grain below a height (m²): that of a circular segment.
fn area_below(grain: &GrainState, height: f64) -> f64 {
    let r = grain.r;
    let z = ((height - grain.x[1]) / r).clamp(-1.0, 1.0);
    r * r * (std::f64::consts::FRAC_PI_2 + z.asin() + z * (1.0 - z * z).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc of radius 1 on the line between two layers: half its area in each, its stress in the upper.
    #[test]
    fn layers_share_a_grain() {
        let grain = GrainState {
            x: [1.0, 2.0],
            r: 1.0,
            contacts: 3,
            virial: Matrix2::new(3.0, 0.0, 0.0, 6.0),
            ..GrainState::default()
        };
        let place = ColumnBox { corner: [0.0, 0.0], size: [3.0, 4.0], loaded: true };
        let layers = profile(&[grain], &place, 0.5, 2);
        for layer in &layers {
            assert!((layer.solid_fraction - 0.5 * std::f64::consts::PI / 6.0).abs() < 1e-12);
        }
        assert_eq!(layers[0].coordination, 0.0);
        assert_eq!(layers[1].coordination, 3.0);
        assert_eq!(layers[1].vertical_stress, 2.0);
        assert_eq!(layers[1].k0(), 0.5);
        assert_eq!(layers[1].height, 3.0);
    }
}
