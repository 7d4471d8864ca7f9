//! The fronts of a pile.

use dempm::fronts::mass_front;
use dempm::trajectory::Frame;

/// Name of the connected front in a frame's budget.
const CONNECTED: &str = "front_connected";

/// Fronts along x, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fronts {
    /// Edge of the point behind which 99 % of the mass is.
    pub mass: f64,
    /// The foremost material that hangs together with the pile, where the trajectory records it.
    pub connected: Option<f64>,
}

/// The fronts of a frame with points of side `spacing` (m).
pub(super) fn fronts(frame: &Frame, mass: &[f64], spacing: f64) -> Fronts {
    let connected = frame.budget.get(CONNECTED).copied();
    Fronts {
        mass: mass_front(&frame.position, mass) + 0.5 * spacing,
        connected: connected.filter(|front| front.is_finite()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_connected_front_is_the_recorded_one() {
        let mut frame = Frame { position: vec![[1.0, 0.5], [3.0, 0.5]], ..Frame::default() };
        let found = |frame: &Frame| fronts(frame, &[1.0, 1.0], 0.25);
        assert_eq!(found(&frame), Fronts { mass: 3.125, connected: None });
        frame.budget.insert(CONNECTED.to_owned(), 2.5);
        assert_eq!(found(&frame).connected, Some(2.5));
        frame.budget.insert(CONNECTED.to_owned(), f64::NAN);
        assert_eq!(found(&frame).connected, None);
    }
}
