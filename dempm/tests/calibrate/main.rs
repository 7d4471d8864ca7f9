//! Calibrations recover the grains that made their data.
//!
//! `cargo test -p dempm --release --test calibrate -- --ignored --nocapture` repeats twenty calibrations of five
//! materials with other seeds.

mod kinds;
mod method;

use std::path::Path;

use dem::{Grains, RveParameters};
use dempm::calibrate::{Laboratory, Posterior, Progress, Simulator, Specimen, Study, Targets};

/// Discs of a packing, packings of each set of parameters and inertial number of slow tests.
const DISCS: usize = 64;
const PACKINGS: u64 = 2;
const INERTIAL: f64 = 5.0e-3;

/// A `[[target]]` and what is measured: a value in place of `@`, or the columns of a table.
struct Test {
    target: &'static str,
    table: Option<Table>,
}

/// Name and title of a table, its abscissae, and the number of its other columns.
struct Table {
    name: &'static str,
    title: &'static str,
    x: &'static [f64],
    columns: usize,
}

/// A biaxial test at 100 kPa.
const BIAXIAL: Test = Test {
    target: "kind = \"biaxial\"\ndata = \"biaxial.csv\"\npressure = 1e5\n\
             sd = { deviatoric_stress = 2e3, volumetric_strain = 5e-4 }\n",
    table: Some(Table {
        name: "biaxial.csv",
        title: "axial_strain [-],deviatoric_stress [Pa],volumetric_strain [-]",
        x: &[0.005, 0.016, 0.027, 0.038, 0.049, 0.06],
        columns: 2,
    }),
};

/// A shear test at 100 kPa.
const SHEAR: Test = Test {
    target: "kind = \"simple-shear\"\ndata = \"shear.csv\"\npressure = 1e5\n\
             sd = { shear_stress = 1e3, volumetric_strain = 1e-3 }\n",
    table: Some(Table {
        name: "shear.csv",
        title: "shear_strain [-],shear_stress [Pa],volumetric_strain [-]",
        x: &[0.01, 0.048, 0.086, 0.124, 0.162, 0.2],
        columns: 2,
    }),
};

/// Writes targets with the measured values of all tests and reads them.
fn load(folder: &Path, head: &str, tests: &[Test], measured: &[f64]) -> Targets {
    let mut text = head.to_string();
    let mut measured = measured.iter();
    for Test { target, table } in tests {
        let Some(Table { name, title, x, columns }) = table else {
            let value = measured.next().unwrap().to_string();
            text += &format!("[[target]]\n{}", target.replace('@', &value));
            continue;
        };
        let mut lines: Vec<String> = x.iter().map(f64::to_string).collect();
        for _ in 0..*columns {
            lines.iter_mut().for_each(|line| *line += &format!(",{}", measured.next().unwrap()));
        }
        std::fs::write(folder.join(name), format!("{title}\n{}\n", lines.join("\n"))).unwrap();
        text += &format!("[[target]]\n{target}");
    }
    let path = folder.join("targets.toml");
    std::fs::write(&path, text).unwrap();
    Targets::load(&path).unwrap()
}

/// Targets whose measurements are means over packings of known grains, as many as calibrations take, from other seeds.
fn synthetic(folder: &Path, head: &str, tests: &[Test], truth: &Grains, seed: u64) -> Targets {
    let values = |test: &Test| test.table.as_ref().map_or(1, |table| table.x.len() * table.columns);
    let ones = vec![1.0; tests.iter().map(values).sum()];
    let blank = load(folder, head, tests, &ones);
    let rve = RveParameters { grains: truth.clone(), ..blank.rve.clone() };
    let specimens: Vec<Specimen> = (0..PACKINGS)
        .map(|k| Specimen { rve: rve.clone(), seed: 1_000_000 + 10 * seed + k })
        .collect();
    let packings = on_cpu().simulate(&blank, &specimens).unwrap().unwrap();
    let packings: Vec<Vec<f64>> = packings.into_iter().collect::<Result<_, _>>().unwrap();
    let mean = |k: usize| packings.iter().map(|p| p[k]).sum::<f64>() / PACKINGS as f64;
    load(folder, head, tests, &(0..ones.len()).map(mean).collect::<Vec<_>>())
}

/// Seed, method and free parameters of a calibration by small packings.
fn head(seed: u64, members: usize, rounds: usize, free: &str) -> String {
    format!(
        "seed = {seed}\n[method]\nmembers = {members}\npackings = {PACKINGS}\nrounds = {rounds}\n\
         points = 6\ninertial_number = {INERTIAL}\n[rve]\ndiscs = {DISCS}\n{free}\n"
    )
}

/// Tests on the GPU, if one works.
fn laboratory() -> Laboratory<()> {
    Laboratory { gpu: gpu::Device::new(0).ok(), progress: () }
}

/// Tests on all cores.
fn on_cpu() -> Laboratory<()> {
    Laboratory { gpu: None, progress: () }
}

fn calibrated(targets: &Targets, simulator: &impl Simulator) -> (Study, Posterior) {
    let mut study = Study::new(targets);
    while !study.is_done(targets) {
        assert!(study.advance(targets, simulator).unwrap());
    }
    let posterior = study.posterior(targets).unwrap();
    (study, posterior)
}

const FRICTION_AND_STIFFNESS: &str = "[free.friction]\nrange = [0.05, 0.9]\n\
    [free.normal_stiffness]\nrange = [3e4, 1e6]\nprior = { kind = \"log-uniform\" }\n";

/// Friction and stiffness from a biaxial and a shear test of small packings: both are determined, and the truth lies
/// within 99 % of the posterior.
#[test]
fn friction_and_stiffness_are_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let truth = Grains { friction: 0.3, normal_stiffness: 2.0e5, ..Grains::default() };
    let head = head(3, 24, 3, FRICTION_AND_STIFFNESS);
    let targets = synthetic(folder.path(), &head, &[BIAXIAL, SHEAR], &truth, 3);
    let (study, posterior) = calibrated(&targets, &laboratory());
    let level = posterior.level(&targets, &[truth.friction, truth.normal_stiffness]);
    println!("{:?} ± {:?}, level {level:.3}", posterior.mean, posterior.sd);
    println!("{:#?}", posterior.identifiability(&targets));
    assert!(level < 0.99, "{level}");
    assert!(posterior.sd[0] < 0.1, "friction is determined");
    assert!(posterior.sd[1] < 0.3 * posterior.mean[1], "stiffness is determined");
    // The ensemble moves towards the data; what is left is the scatter of packings of 64 discs.
    let misfit = |round: usize| {
        let members = &study.rounds[round];
        members.iter().map(|member| member.misfit).sum::<f64>() / members.len() as f64
    };
    assert!(misfit(3) < 0.6 * misfit(0), "{} {}", misfit(0), misfit(3));
}

/// A study that is written and read between two rounds goes on with the same bits; one that is stopped does not go on.
#[test]
fn a_study_resumes_with_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("targets.toml");
    let text = "[method]\nmembers = 8\npackings = 1\nrounds = 2\ninertial_number = 0.05\n\
                [rve]\ndiscs = 30\n[free.friction]\nrange = [0.1, 0.8]\n\
                [[target]]\nkind = \"critical-friction\"\npressure = 1e5\nangle = 16.0\nsd = 2.0\n\
                [[target]]\nkind = \"bulk-density\"\npressure = 1e5\ndensity = 2250.0\nsd = 20.0\n";
    std::fs::write(&path, text).unwrap();
    let targets = Targets::load(&path).unwrap();
    let (through, posterior) = calibrated(&targets, &on_cpu());
    let mut study = Study::new(&targets);
    assert!(study.advance(&targets, &on_cpu()).unwrap());
    let bytes = postcard::to_stdvec(&study).unwrap();
    let mut resumed: Study = postcard::from_bytes(&bytes).unwrap();
    assert!(resumed.is_of(&targets));
    struct Stopped;
    impl Progress for Stopped {
        fn stop(&self) -> bool {
            true
        }
    }
    let stopped = Laboratory { gpu: None, progress: Stopped };
    assert!(!resumed.advance(&targets, &stopped).unwrap());
    while !resumed.is_done(&targets) {
        assert!(resumed.advance(&targets, &on_cpu()).unwrap());
    }
    assert_eq!(through, resumed);
    assert_eq!(posterior.mean, resumed.posterior(&targets).unwrap().mean);
    std::fs::write(&path, text.replace("16.0", "17.0")).unwrap();
    assert!(!study.is_of(&Targets::load(&path).unwrap()));
}

#[test]
fn wrong_targets_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("targets.toml");
    let free = "[free.friction]\nrange = [0.1, 0.8]\n";
    let target =
        "[[target]]\nkind = \"critical-friction\"\npressure = 1e5\nangle = 16.0\nsd = 2.0\n";
    std::fs::write(
        folder.path().join("b.csv"),
        "axial_strain [%],deviatoric_stress [kPa]\n0,0\n1,50\n2,60\n",
    )
    .unwrap();
    let biaxial = "[[target]]\nkind = \"biaxial\"\ndata = \"b.csv\"\npressure = 1e5\nsd = ";
    for (text, problem) in [
        (free.to_string(), "[free.KEY] and [[target]] need each other"),
        (target.to_string(), "[free.KEY] and [[target]] need each other"),
        (format!("[free.skin]\nrange = [0.1, 0.3]\n{target}"), "`skin` cannot be free"),
        (
            format!("[free.friction]\nrange = [0.8, 0.1]\n{target}"),
            "the range of `friction` must rise",
        ),
        (format!("[free.friction]\nrange = [0.1, 20.0]\n{target}"), "`grains.friction` is 20"),
        (format!("{free}{}", target.replace("1e5", "-1.0")), "`pressure` must be positive"),
        (format!("{free}{}", target.replace("sd = 2.0", "sd = 0.0")), "`sd` must be positive"),
        (format!("{free}{}", target.replace("16.0", "160")), "`angle` is in degrees"),
        (format!("{free}{}", target.replace("angle", "angel")), "unknown field `angel`"),
        (
            format!("{free}{biaxial}{{ deviatoric_stress = 0.0 }}\n"),
            "`sd.deviatoric_stress` must be positive",
        ),
        (
            format!("{free}{biaxial}{{ volumetric_strain = 1e-3 }}\n"),
            "the table has no such column",
        ),
        (format!("[method]\nmembers = 2\n{free}{target}"), "8 members"),
    ] {
        std::fs::write(&path, &text).unwrap();
        let error = Targets::load(&path).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}\n{text}");
    }
    std::fs::write(&path, format!("{free}{biaxial}{{ deviatoric_stress = 1e3 }}\n")).unwrap();
    assert_eq!(Targets::load(&path).unwrap().observed(), [0.0, 50.0e3, 60.0e3]);
}

/// Free parameters of the materials, in the order of their keys.
const THREE: &str = "[free.friction]\nrange = [0.05, 0.9]\n\
    [free.rolling_friction]\nrange = [0.0, 0.5]\n\
    [free.normal_stiffness]\nrange = [3e4, 1e6]\nprior = { kind = \"log-uniform\" }\n";

/// Friction, rolling friction and normal stiffness (N/m): the first at the end of the range of rolling friction.
const MATERIALS: [[f64; 3]; 5] = [
    [0.5, 1.0e-4, 1.0e5],
    [0.3, 0.1, 2.0e5],
    [0.6, 0.2, 1.0e5],
    [0.4, 0.3, 4.0e5],
    [0.7, 0.05, 6.0e4],
];

fn grains([friction, rolling_friction, normal_stiffness]: [f64; 3]) -> Grains {
    Grains { friction, rolling_friction, normal_stiffness, ..Grains::default() }
}

/// The free parameters of grains, in the order of their keys.
fn values(grains: &Grains) -> [f64; 3] {
    [grains.friction, grains.normal_stiffness, grains.rolling_friction]
}

/// Five materials, four calibrations each: the truth lies within the 95 % region of at least 18 of 20 posteriors.
#[test]
#[ignore = "half an hour on two cores: cargo test -p dempm --release --test calibrate -- --ignored --nocapture"]
fn the_truth_lies_within_the_posterior() {
    let mut within = 0;
    for repetition in 0..4 {
        for (case, material) in MATERIALS.into_iter().enumerate() {
            let truth = grains(material);
            let folder = tempfile::tempdir().unwrap();
            let seed = 1 + 10 * case as u64 + repetition;
            let head = head(seed, 24, 3, THREE);
            let targets = synthetic(folder.path(), &head, &[BIAXIAL, SHEAR], &truth, seed);
            let (_, posterior) = calibrated(&targets, &laboratory());
            let level = posterior.level(&targets, &values(&truth));
            within += usize::from(level < 0.95);
            println!(
                "{:?}: {:.4?} ± {:.4?}, level {level:.3}, {within} within",
                values(&truth),
                posterior.mean,
                posterior.sd
            );
        }
    }
    println!("{within} of 20 within the 95 % region");
    assert!(within >= 18, "{within} of 20");
}
