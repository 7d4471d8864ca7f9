//! Runout and height of columns of several aspect ratios, with RVEs and with the mu(I) law.

use dempm::scene::Scene;

use crate::run::Run;

const RATIOS: [f64; 4] = [0.5, 1.0, 2.0, 3.0];

pub fn study() -> miette::Result<()> {
    println!("| material | a = H/L0 | (L - L0)/L0 | H_end/L0 |");
    println!("|---|---|---|---|");
    for material in ["rve", "mu-i"] {
        let mut runouts = Vec::new();
        for a in RATIOS {
            let run = Run::new(column(material, a)?)?;
            // Points are centres of squares of 1/16 m.
            let (front, height) = (run.front() + 1.0 / 32.0, run.height() + 1.0 / 32.0);
            println!("| {material} | {a} | {:.2} | {height:.2} |", front - 1.0);
            runouts.push(front - 1.0);
        }
        let (exponent, prefactor) = power_law(&RATIOS, &runouts);
        println!("| {material} | fit | {prefactor:.2} a^{exponent:.2} | |");
    }
    Ok(())
}

/// A column 1 m wide against the left wall of a long box, until it is at rest:
/// 5.5 sqrt(H / g), well beyond the 3.3 sqrt(H / g) of sand.
fn column(material: &str, a: f64) -> miette::Result<Scene> {
    let frames = (5.5 * (a / 9.81_f64).sqrt() / 0.01).ceil();
    let text = format!(
        r#"
        title = "a = {a}"
        duration = {}
        [domain]
        size = [12.0, 3.5]
        cell = 0.125
        [[column]]
        size = [1.0, {a:?}]
        [material]
        kind = "{material}"
        {}
        "#,
        frames * 0.01,
        if material == "rve" { "[rve]\ndiscs = 200" } else { "" },
    );
    Ok(Scene::parse(&text, "runout")?)
}

/// Least-squares `y = c x^n` in logarithms: `(n, c)`.
fn power_law(x: &[f64], y: &[f64]) -> (f64, f64) {
    let n = x.len() as f64;
    let mean = |v: &[f64]| v.iter().map(|v| v.ln()).sum::<f64>() / n;
    let (mx, my) = (mean(x), mean(y));
    let covariance: f64 = x.iter().zip(y).map(|(x, y)| (x.ln() - mx) * (y.ln() - my)).sum();
    let variance: f64 = x.iter().map(|x| (x.ln() - mx).powi(2)).sum();
    let exponent = covariance / variance;
    (exponent, (my - exponent * mx).exp())
}
