//! Frames of several runs at the same time.

/// Relative tolerance on equal times.
const ROUNDING: f64 = 1e-6;

/// For each time that all runs have a frame at, the number of that frame in each; `times` are those of the frames
/// of each run (s), in order.
pub fn common_frames(times: &[&[f64]]) -> Vec<Vec<usize>> {
    let Some((first, others)) = times.split_first() else { return Vec::new() };
    let mut places = vec![0; others.len()];
    let mut found = Vec::new();
    for (frame, &time) in first.iter().enumerate() {
        let same = |other: f64| (other - time).abs() <= ROUNDING * time.abs();
        let mut frames = vec![frame];
        for (place, other) in places.iter_mut().zip(others) {
            while *place < other.len() && other[*place] < time && !same(other[*place]) {
                *place += 1;
            }
            frames.extend(other.get(*place).filter(|other| same(**other)).map(|_| *place));
        }
        if frames.len() == times.len() {
            found.push(frames);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_matched_by_time() {
        let fine = [0.0, 0.1, 0.2, 0.30000000001, 0.4];
        let coarse = [0.0, 0.2, 0.4, 0.6];
        assert_eq!(common_frames(&[&fine, &coarse]), [[0, 0], [2, 1], [4, 2]]);
        assert_eq!(common_frames(&[&[0.0, 0.3], &fine]), [[0, 0], [1, 3]]);
        assert_eq!(common_frames(&[&coarse, &fine, &[0.1, 0.4]]), [[2, 4, 1]]);
        assert_eq!(common_frames(&[&[0.05], &fine]), [[0; 2]; 0]);
        assert_eq!(common_frames(&[&coarse[..2]]), [[0], [1]]);
    }
}
