//! Stop, write, read, go on: bit for bit the uninterrupted run.

use dem::{Real, RveBatch, RveState};
use rstest::rstest;

use crate::batch::{batch, motions};
use crate::common::{DENSE, parameters};

#[rstest]
fn restart_is_bitwise(
    #[values(true, false)] single: bool,
    #[values(0.0, 0.3)] rolling_friction: f64,
) {
    fn check<R: Real>(rolling_friction: f64) {
        let mut p = parameters(20.0e3, DENSE);
        p.grains.rolling_friction = rolling_friction;
        let l = motions(6);
        let mut states = vec![RveState::default(); 6];
        let mut run = batch::<R>(&p, 6);
        for _ in 0..33 {
            run.advance(1e-4, &l, &mut states).unwrap();
        }
        // Also while some RVEs are free and some lists are about to be made anew.
        let bytes = postcard::to_stdvec(&run).unwrap();
        let mut restarted: RveBatch<R> = postcard::from_bytes(&bytes).unwrap();
        assert_eq!(restarted, run);
        let mut restarted_states = states.clone();
        for _ in 0..33 {
            run.advance(1e-4, &l, &mut states).unwrap();
            restarted.advance(1e-4, &l, &mut restarted_states).unwrap();
            assert_eq!(restarted_states, states);
        }
        assert_eq!(postcard::to_stdvec(&restarted).unwrap(), postcard::to_stdvec(&run).unwrap());
    }
    if single {
        check::<f32>(rolling_friction);
    } else {
        check::<f64>(rolling_friction);
    }
}
