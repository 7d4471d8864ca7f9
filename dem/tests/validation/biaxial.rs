//! D10, D11, D12, D18. Drained biaxial tests: peak, dilatancy, critical state, size of the RVE.

use dem::RveParameters;
use dem::element::{Row, Stage, sin_phi};

use crate::common::{DENSE, LOOSE, expect, mean_and_deviation, parameters, path};

/// Axial shortening and volumetric expansion (logarithmic) at each row.
fn strains(row: &Row) -> (f64, f64) {
    (-row.strain[(1, 1)], row.strain.trace())
}

/// Mean of a quantity over the rows with axial strains in `range`.
fn mean(rows: &[Row], range: std::ops::Range<f64>, f: impl Fn(&Row) -> f64) -> f64 {
    let chosen: Vec<f64> = rows.iter().filter(|r| range.contains(&strains(r).0)).map(f).collect();
    mean_and_deviation(&chosen).0
}

/// Largest sin phi of a row, and its axial strain.
fn peak(rows: &[Row]) -> (f64, f64) {
    rows.iter()
        .map(|r| (sin_phi(&r.stress), strains(r).0))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap()
}

fn biaxial(p: &RveParameters, seed: u64, rate: f64, strain: f64, window: f64) -> Vec<Row> {
    let pressure = p.preparation.pressure;
    path(p, seed, &Stage::Biaxial { pressure, shortening_rate: rate, strain }, window / rate)
}

/// D10. Dense: peak sin phi 0.458 ± 0.019 (standard deviation of six seeds, windows of 0.5 %) at
/// 1.5 to 5.5 %; dilatancy d eps_v / d eps_1 = -0.55 near the peak (seeds scatter by 0.1).
///
/// The expansion at 15 % can hardly exceed ln(phi_0 / phi_cs) = ln(0.844 / 0.812) = 3.9 %: the
/// 5.8 % of the same source contradict its own critical state.
#[test]
#[ignore = "statistical, 1 min: cargo test -p dem --release biaxial -- --ignored --nocapture"]
fn dense() {
    let p = parameters(20.0e3, DENSE);
    let (mut peaks, mut dilatancy, mut expansion) = (vec![], vec![], vec![]);
    for seed in 1..=6 {
        let rows = biaxial(&p, seed, 0.05, 0.16, 0.005);
        let (value, at) = peak(&rows);
        // Slope of the volume change over ±1 % of axial strain around the peak.
        let near: Vec<_> =
            rows.iter().map(strains).filter(|(e, _)| (e - at).abs() < 0.0101).collect();
        let (first, last) = (near[0], near[near.len() - 1]);
        let slope = (last.1 - first.1) / (last.0 - first.0);
        let volume = mean(&rows, 0.145..0.155, |r| strains(r).1);
        println!(
            "seed {seed}: peak {value:.3} at {at:.3}, dilatancy {slope:.2}, expansion {volume:.4}"
        );
        peaks.push(value);
        dilatancy.push(slope);
        expansion.push(volume);
        assert!((0.005..0.07).contains(&at), "peak at {at}");
    }
    let (value, deviation) = mean_and_deviation(&peaks);
    println!("peak {value:.3} ± {deviation:.3}");
    expect("peak sin phi", value, 0.458, 0.02);
    expect("dilatancy", mean_and_deviation(&dilatancy).0, 0.55, 0.15);
    expect("expansion at 15 %", mean_and_deviation(&expansion).0, 0.037, 0.01);
}

/// D11. Loose: no clear peak (0.32 to 0.36 by fluctuation), then the critical state's 0.28 (means
/// of 0.28 to 0.30 over six seeds; 0.24 to 0.28 from another code), nearly isochoric.
#[test]
#[ignore = "statistical, 1 min: cargo test -p dem --release biaxial -- --ignored --nocapture"]
fn loose() {
    let p = parameters(20.0e3, LOOSE);
    let (mut peaks, mut residual, mut expansion) = (vec![], vec![], vec![]);
    for seed in 1..=6 {
        let rows = biaxial(&p, seed, 0.05, 0.16, 0.005);
        peaks.push(peak(&rows).0);
        residual.push(mean(&rows, 0.08..0.16, |r| sin_phi(&r.stress)));
        expansion.push(mean(&rows, 0.145..0.155, |r| strains(r).1));
    }
    println!("peaks {peaks:.3?}\nresidual {residual:.3?}\nexpansion {expansion:.4?}");
    expect("peak sin phi", mean_and_deviation(&peaks).0, 0.34, 0.05);
    expect("residual sin phi", mean_and_deviation(&residual).0, 0.28, 0.035);
    expect("expansion at 15 %", mean_and_deviation(&expansion).0, -0.01, 0.015);
}

/// D12. Critical state at kn / (p t) = 667, from dense and loose packings beyond 15 %:
/// phi 0.810 to 0.816, Z 3.05 ± 0.1, sin phi 0.28 ± 0.02.
#[test]
#[ignore = "statistical, 2 min: cargo test -p dem --release biaxial -- --ignored --nocapture"]
fn critical_state() {
    for friction in [DENSE, LOOSE] {
        let p = parameters(20.0e3, friction);
        let mut means = [vec![], vec![], vec![]];
        for seed in 1..=4 {
            let rows = biaxial(&p, seed, 0.05, 0.40, 0.005);
            let range = 0.2..0.4;
            means[0].push(mean(&rows, range.clone(), |r| r.solid_fraction));
            means[1].push(mean(&rows, range.clone(), |r| r.coordination));
            means[2].push(mean(&rows, range, |r| sin_phi(&r.stress)));
        }
        println!("preparation friction {friction}: {means:.3?}");
        let [phi, z, s] = means.map(|m| mean_and_deviation(&m).0);
        expect("solid fraction", phi, 0.813, 0.005);
        expect("coordination", z, 3.05, 0.1);
        expect("sin phi", s, 0.28, 0.02);
    }
}

/// D18. Discs per RVE: peak .479 / .482 / .463 and mean over 5 to 10 % .378 / .327 / .338 for 100,
/// 400 and 1600 discs (loading 0.1/s, windows 0.25 %), within two of their standard deviations.
#[test]
#[ignore = "statistical, 2 min: cargo test -p dem --release biaxial -- --ignored --nocapture"]
fn size_of_the_rve() {
    for (discs, seeds, target_peak, target_mean, tolerance) in [
        (100, 8, 0.479, 0.378, [0.025, 0.035]),
        (400, 6, 0.482, 0.327, [0.017, 0.022]),
        (1600, 3, 0.463, 0.338, [0.012, 0.013]),
    ] {
        let p = RveParameters { discs, ..parameters(20.0e3, DENSE) };
        let (mut peaks, mut means) = (vec![], vec![]);
        for seed in 1..=seeds {
            let rows = biaxial(&p, seed, 0.1, 0.10, 0.0025);
            peaks.push(peak(&rows).0);
            means.push(mean(&rows, 0.05..0.10, |r| sin_phi(&r.stress)));
        }
        let (peak, peak_deviation) = mean_and_deviation(&peaks);
        let (value, deviation) = mean_and_deviation(&means);
        println!(
            "N = {discs}: peak {peak:.3} ± {peak_deviation:.3}, 5-10 % {value:.3} ± {deviation:.3}"
        );
        expect("peak", peak, target_peak, 2.0 * tolerance[0]);
        expect("mean over 5 to 10 %", value, target_mean, 2.0 * tolerance[1]);
    }
}
