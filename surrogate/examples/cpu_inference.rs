//! Times of one frame of a rollout on the processor: the plain network and the fast one.
//!
//! `cargo run --release -p surrogate --example cpu_inference -- [POINTS] [NETWORK]`

use std::time::Instant;

use surrogate::features::{Normalisation, Window, window_input};
use surrogate::inference::Inference;
use surrogate::network::burn_backend::{Cpu, device};
use surrogate::network::{Model, ModelConfig};

/// Frames timed, after one that is not. Both networks take turns, so that what else the processor does
/// slows down both; the median of the ratios is what counts.
const FRAMES: usize = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let points: usize = arguments.next().map_or(Ok(1000), |text| text.parse())?;
    let name = arguments.next().unwrap_or("baseline".to_owned());
    let config = ModelConfig::named(&name).ok_or("no such network")?;
    let model = Model::<Cpu>::new(&config, 1, &device());
    let mut inference = Inference::new(&model, &config, 1);
    let norm = Normalisation::about_zero(2, 0.01, 0.1);
    // A column of points 1/16 m apart, each a little off its place, that flows apart.
    let columns = (points as f64).sqrt().ceil() as usize;
    let offset = |k: usize| (k as f64 * 0.618_034).fract() * 0.02;
    let frame = |time: usize| -> Vec<f32> {
        let stretch = 1.0 + 1e-3 * time as f64;
        let place = |k: usize, n: usize| ((n as f64 + 0.5) / 16.0 * stretch + offset(k)) as f32;
        (0..points).flat_map(|k| [place(k, k % columns), place(3 * k, k / columns)]).collect()
    };
    let frames: Vec<Vec<f32>> = (0..config.frames + FRAMES).map(frame).collect();
    let (mut features, mut plain, mut fast) = (Vec::new(), Vec::new(), Vec::new());
    let (mut difference, mut edges) = (0.0_f32, 0);
    for (k, frames) in frames.windows(config.frames).enumerate() {
        let began = Instant::now();
        let window = Window { positions: &frames.concat(), points, statics: &[], obstacles: &[] };
        let input = window_input::<Cpu>(&[window], &config, &norm, &[[0.0, 10.0]; 2], &device());
        let prepared = began.elapsed();
        let began = Instant::now();
        let expected: Vec<f32> = model.forward(&input).into_data().iter::<f32>().collect();
        let slow = began.elapsed();
        let began = Instant::now();
        let found = inference.forward(&input);
        let quick = began.elapsed();
        let pairs = found.iter().zip(&expected);
        difference = pairs.map(|(a, b)| (a - b).abs()).fold(difference, f32::max);
        edges = input.frames[0].edges.dims()[0];
        if k > 0 {
            for (list, time) in [(&mut features, prepared), (&mut plain, slow), (&mut fast, quick)]
            {
                list.push(1e3 * time.as_secs_f64());
            }
        }
    }
    let ratios: Vec<f64> = plain.iter().zip(&fast).map(|(plain, fast)| plain / fast).collect();
    let [features, plain, fast, [least, median, most]] =
        [features, plain, fast, ratios].map(sorted);
    println!("{name}, {points} points, {edges} edges, {} threads", rayon::current_num_threads());
    println!(
        "median of {FRAMES} frames, ms: features {:.1}, plain {:.1}, fast {:.1}",
        features[1], plain[1], fast[1]
    );
    println!(
        "{median:.2} times as fast ({least:.2} to {most:.2}); largest difference {difference:.1e}"
    );
    Ok(())
}

/// The least, the median and the most.
fn sorted(mut list: Vec<f64>) -> [f64; 3] {
    list.sort_by(f64::total_cmp);
    [list[0], list[list.len() / 2], list[list.len() - 1]]
}
