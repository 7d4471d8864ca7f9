//! When a flow comes to rest.

/// Share of the largest kinetic energy below which material counts as at rest.
pub const AT_REST: f64 = 0.01;

/// The first time (s) after which the kinetic energy stays below one per cent of its largest value; `None`
/// if it does not until the end.
pub fn arrest(time: &[f64], kinetic_energy: &[f64]) -> Option<f64> {
    let largest = kinetic_energy.iter().copied().fold(0.0, f64::max);
    let last = kinetic_energy.iter().rposition(|energy| *energy >= AT_REST * largest)?;
    time.get(last + 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flow_is_at_rest_after_its_last_motion() {
        let time = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];
        assert_eq!(arrest(&time, &[0.0, 1.0, 0.005, 0.5, 0.009, 0.0]), Some(0.4));
        assert_eq!(arrest(&time, &[0.0, 1.0, 0.5, 0.5, 0.2, 0.01]), None);
        assert_eq!(arrest(&[], &[]), None);
    }
}
