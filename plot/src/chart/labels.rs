//! Where labels stand beside their points.

/// Mean width of a character over the nominal size of the text, of which plotters draws four fifths.
const ASPECT: f64 = 0.42;
/// Half the width of a mark, pixels.
const MARK: i32 = 6;

/// Left, top, right and bottom, pixels.
pub(super) type Rectangle = [i32; 4];

/// Offsets of the upper left corners of labels from their points: of some places around each point,
/// the one that covers the fewest marks and labels and stays within `frame`.
pub(super) fn offsets(
    labels: &[([i32; 2], &str)],
    marks: &[[i32; 2]],
    frame: Rectangle,
    height: u32,
) -> Vec<(i32, i32)> {
    let mut taken: Vec<Rectangle> =
        marks.iter().map(|[x, y]| [x - MARK, y - MARK, x + MARK, y + MARK]).collect();
    let mut offsets = Vec::new();
    for ([x, y], text) in labels {
        let width = (text.chars().count() as f64 * ASPECT * f64::from(height)).ceil() as i32;
        let height = height as i32;
        let (right, left, centre) = (8, -8 - width, -width / 2);
        let candidates =
            [(right, -15), (right, 2), (left, -15), (left, 2), (centre, -9 - height), (centre, 9)];
        let place = |(dx, dy): (i32, i32)| [x + dx, y + dy, x + dx + width, y + dy + height];
        let cost = |offset: &(i32, i32)| {
            let own = place(*offset);
            let outside =
                own[0] < frame[0] || own[1] < frame[1] || own[2] > frame[2] || own[3] > frame[3];
            let covered = taken.iter().filter(|other| overlap(&own, other)).count();
            covered + if outside { 1000 } else { 0 }
        };
        let best = candidates.into_iter().min_by_key(cost).unwrap_or((right, -15));
        taken.push(place(best));
        offsets.push(best);
    }
    offsets
}

fn overlap(a: &Rectangle, b: &Rectangle) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_avoid_marks_and_the_edge() {
        let frame = [0, 0, 200, 100];
        let of =
            |point: [i32; 2], marks: &[[i32; 2]]| offsets(&[(point, "label")], marks, frame, 14)[0];
        assert_eq!(of([50, 50], &[[50, 50]]), (8, -15));
        assert_eq!(of([50, 50], &[[50, 50], [70, 42]]), (8, 2));
        assert!(of([190, 50], &[]).0 < -8);
        let both = offsets(&[([50, 50], "one"), ([52, 50], "other")], &[], frame, 14);
        assert_ne!(both[0], both[1]);
    }
}
