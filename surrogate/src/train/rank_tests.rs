//! Ranks hold equal weights, and learn what one process with all windows would.

use std::net::TcpListener;
use std::thread;

use super::engine::{CpuEngine, Preparation, Random, State};
use super::ranks::{AllReduce, Alone, Place};
use super::tcp::Tcp;
use crate::config::ModelConfig;
use crate::data::Batch;
use crate::features::Normalisation;

const STEPS: u64 = 20;
const RANDOM: Random = Random { seed: 3, message_scale: 1.0 };

fn preparation() -> Preparation {
    let config = ModelConfig { width: 8, frames: 3, connection_radius: 0.3, ..Default::default() };
    let normalisation = Normalisation {
        velocity_mean: vec![0.0; 2],
        velocity_std: vec![0.01; 2],
        acceleration_mean: vec![0.0; 2],
        acceleration_std: vec![1.0; 2],
        ..Normalisation::default()
    };
    Preparation { config, normalisation, bounds: [[0.0, 1.0]; 2] }
}

/// Windows of different sizes, so that they weigh differently in the loss.
fn batch(step: u64, windows: std::ops::Range<u64>) -> Batch {
    let mut batch = Batch::default();
    for window in windows {
        let number = (4 * step + window) as f32;
        let points = 6 + 3 * window as usize;
        let at = |i: usize| 0.5 + 0.4 * ((i as f32) * 1.7 + number).sin();
        batch
            .windows
            .push((0..3 * 2 * points).map(|i| at(i % (2 * points)) + 1e-3 * (i as f32)).collect());
        batch.targets.extend((0..2 * points).map(|i| (i as f32 + number).cos() * (1.0 + number)));
        batch.points.push(points);
        batch.statics.push(Vec::new());
    }
    batch
}

/// Trains on some of the four windows of each step.
fn train(windows: std::ops::Range<u64>, ranks: &mut dyn AllReduce) -> (State, Vec<f64>) {
    let preparation = preparation();
    let mut engine = CpuEngine::new(&preparation.config, RANDOM, 0.9);
    for step in 0..STEPS {
        let graph = preparation.prepare(&batch(step, windows.clone()));
        engine.step(graph, 1e-3, ranks).unwrap();
    }
    (engine.state().clone(), engine.take_losses())
}

#[test]
fn ranks_hold_equal_weights_and_learn_like_one() {
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let ranks: Vec<_> = (0..2)
        .map(|rank| {
            let place = Place { rank, ranks: 2, address: address.clone() };
            thread::spawn(move || {
                let first = 2 * rank as u64;
                train(first..first + 2, &mut Tcp::join(place, &[0; 32]).unwrap())
            })
        })
        .collect();
    let [first, second] =
        ranks.into_iter().map(|rank| rank.join().unwrap()).collect::<Vec<_>>().try_into().unwrap();
    assert_eq!(first, second);

    let start = CpuEngine::new(&preparation().config, RANDOM, 0.9).state().clone();
    let (one, losses) = train(0..4, &mut Alone);
    let distance =
        |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(distance(&start.weights, &one.weights) > 1e-3, "nothing was learnt");
    // Sums in another order; Adam's first steps divide small gradients by their own size.
    assert!(distance(&first.0.weights, &one.weights) < 2e-5);
    for (a, b) in losses.iter().zip(&first.1) {
        assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
    }
}
