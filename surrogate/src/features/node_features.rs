//! Values of the optional node features ([`NodeFeature`]).

use dempm::scene::Scene;
use dempm::trajectory::Frame;

use super::material::material;
use super::normalisation::Normalisation;
use super::obstacle::Obstacle;
use super::surfaces::surfaces;
use crate::network::{NodeFeature, feature_columns};

/// A field that a feature needs, but the trajectory lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no {0} in it")]
pub struct MissingField(pub &'static str);

/// Static features from the first frame of a trajectory and its scene, points x columns.
///
/// # Errors
/// If the frame lacks a field.
pub fn static_features(
    features: &[NodeFeature],
    first: &Frame,
    scene: &Scene,
) -> Result<Vec<f32>, MissingField> {
    let mut columns: Vec<Vec<f32>> = Vec::new();
    let points = first.position.len();
    for feature in features {
        match feature {
            NodeFeature::Overburden | NodeFeature::Acceleration | NodeFeature::Surfaces => {}
            NodeFeature::Material => {
                columns.extend(material(scene).map(|value| vec![value; points]));
            }
            NodeFeature::InitialStress => {
                let stress = first.stress.as_ref().ok_or(MissingField("stress"))?;
                let pressure = |[xx, _, _, yy]: &[f32; 4]| -0.5 * (xx + yy);
                let shear = |[xx, xy, yx, yy]: &[f32; 4]| (0.5 * (xx - yy)).hypot(0.5 * (xy + yx));
                columns.push(stress.iter().map(pressure).collect());
                columns.push(stress.iter().map(shear).collect());
            }
            NodeFeature::InitialSolidFraction => {
                let fraction =
                    first.solid_fraction.as_ref().ok_or(MissingField("solid fraction"))?;
                columns.push(fraction.clone());
            }
        }
    }
    Ok((0..points).flat_map(|point| columns.iter().map(move |column| column[point])).collect())
}

/// Features of a frame that depend on positions, points x columns each. `frames` are the positions
/// (m, points x 2) in the frame and those before, the newest last; the frame is `back` frames before the
/// one for which `obstacles` are given. A feature that needs more frames is empty.
pub fn moving_features(
    features: &[NodeFeature],
    frames: &[&[f32]],
    obstacles: &[Obstacle],
    back: usize,
    radius: f32,
) -> Vec<Vec<f32>> {
    let moving = features.iter().filter(|feature| !feature.is_static());
    moving
        .map(|feature| match (feature, frames) {
            (NodeFeature::Acceleration, [.., a, b, c]) => {
                (0..c.len()).map(|k| (c[k] - b[k]) - (b[k] - a[k])).collect()
            }
            (NodeFeature::Overburden, [.., now]) => overburden(now, radius),
            (NodeFeature::Surfaces, [.., now]) => surfaces(now, obstacles, back, radius),
            _ => Vec::new(),
        })
        .collect()
}

/// All features, standardised, points x columns: the static ones and those of [`moving_features`].
pub fn standardised(
    features: &[NodeFeature],
    norm: &Normalisation,
    points: usize,
    statics: &[f32],
    moving: &[Vec<f32>],
) -> Vec<f32> {
    let dimensions = norm.velocity_mean.len();
    let [all, width] = feature_columns(features, dimensions);
    let mut values = Vec::with_capacity(points * all);
    for point in 0..points {
        let mut mine = &statics[point * width..(point + 1) * width];
        let mut others = moving.iter();
        for feature in features {
            let count = feature.columns(dimensions);
            if feature.is_static() {
                let (these, rest) = mine.split_at(count);
                values.extend(these);
                mine = rest;
            } else if let Some(all) = others.next() {
                values.extend(&all[point * count..(point + 1) * count]);
            }
        }
    }
    let scales = norm.features_mean.iter().zip(&norm.features_std).cycle();
    for (value, (mean, std)) in values.iter_mut().zip(scales) {
        *value = (*value - *mean as f32) / *std as f32;
    }
    values
}

/// Number of points above each point, within half a radius to either side. `positions` (m) are points
/// x 2.
pub fn overburden(positions: &[f32], radius: f32) -> Vec<f32> {
    let points = positions.as_chunks::<2>().0;
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_unstable_by(|&a, &b| points[a][0].total_cmp(&points[b][0]));
    let half = radius / 2.0;
    let mut count = vec![0.0; points.len()];
    let mut first = 0;
    for &v in &order {
        let x = points[v];
        while points[order[first]][0] < x[0] - half {
            first += 1;
        }
        let strip = order[first..].iter().map(|&w| points[w]).take_while(|y| y[0] <= x[0] + half);
        let beside = |y: &[f32; 2]| (y[0] - x[0]).abs() <= half;
        count[v] = strip.filter(|y| y[1] > x[1] && beside(y)).count() as f32;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overburden_counts_the_points_of_a_strip() {
        // Three columns 0.1 apart with 1, 2 and 3 points, and a stray one far above the first.
        let positions = [0.0, 0.0, 0.1, 0.0, 0.1, 0.1, 0.2, 0.0, 0.2, 0.1, 0.2, 0.2, 0.04, 9.0];
        let narrow = overburden(&positions, 0.1);
        assert_eq!(narrow, [1.0, 1.0, 0.0, 2.0, 1.0, 0.0, 0.0]);
        let wide = overburden(&positions, 0.25);
        assert_eq!(wide, [2.0, 4.0, 2.0, 3.0, 1.0, 0.0, 0.0]);
        // Positions that are not numbers have nothing above or below them.
        assert_eq!(overburden(&[f32::NAN, 0.0, 0.0, 1.0], 0.1)[1], 0.0);
    }

    #[test]
    fn an_acceleration_needs_three_frames() {
        let frames: [&[f32]; 3] = [&[0.0, 0.0], &[1.0, 0.0], &[3.0, -1.0]];
        let moving = |frames| moving_features(&[NodeFeature::Acceleration], frames, &[], 0, 0.1);
        assert_eq!(moving(&frames), [[1.0, -1.0]]);
        assert_eq!(moving(&frames[1..]), [[0.0; 0]], "and not an overburden");
    }

    #[test]
    fn stress_becomes_invariants() {
        let first = Frame {
            position: vec![[0.0; 2]; 2],
            stress: Some(vec![[-3.0, 4.0, 4.0, -9.0], [0.0; 4]]),
            solid_fraction: Some(vec![0.8, 0.7]),
            ..Frame::default()
        };
        let all = [
            NodeFeature::InitialSolidFraction,
            NodeFeature::Overburden,
            NodeFeature::InitialStress,
        ];
        assert_eq!(feature_columns(&all, 2), [4, 3]);
        let text = "duration = 1.0\n[domain]\nsize = [4.0, 2.0]\n[[column]]\nsize = [0.5, 0.5]\n";
        let scene = Scene::parse(text, "scene.toml").unwrap();
        let found = static_features(&all, &first, &scene);
        assert_eq!(found, Ok(vec![0.8, 6.0, 5.0, 0.7, 0.0, 0.0]));
        let bare = Frame { solid_fraction: None, ..first };
        assert_eq!(static_features(&all, &bare, &scene), Err(MissingField("solid fraction")));
    }
}
