//! Prints the findings of the stability studies whose names are given.
use std::time::Instant;

use validation::stability::{Size, Study, dem_step, mpm_step};

fn main() {
    let studies = [("mpm-step", mpm_step::study as fn(Size) -> _), ("dem-step", dem_step::study)];
    for (name, study) in studies {
        if std::env::args().any(|a| a == name) {
            let start = Instant::now();
            match study(Size::Quick) {
                Ok(study) => print(&study),
                Err(e) => println!("{name}: {e}"),
            }
            println!("{:?}", start.elapsed());
        }
    }
}

fn print(study: &Study) {
    for f in &study.findings {
        println!(
            "{} | {} | {} | {:?} | {:?}: {}",
            f.case,
            f.parameter,
            f.measured,
            f.theory,
            f.beyond.kind(),
            f.beyond.text()
        );
    }
    for m in &study.maps {
        println!("{} {} {:?} {:?}", m.title, m.x.label, m.x.values, m.theory);
        for (y, row) in m.y.values.iter().zip(&m.outcomes) {
            let letters: String = row.iter().map(|o| o.kind().name()[..1].to_owned()).collect();
            println!("{y:9.3} {letters}");
        }
    }
    for c in &study.charts {
        println!("{}", c.title);
        for k in &c.curves {
            println!("  {}: {:.4?}", k.name, k.points);
        }
    }
}
