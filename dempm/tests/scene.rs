//! Every scene file that ships with the project is valid and is the scene it claims to be.

use std::path::{Path, PathBuf};

use dem::cuda::Room;
use dempm::check::{Needs, Rates};
use dempm::scene::{Material, Rve, Scene};

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

fn load(path: &Path) -> Scene {
    Scene::load(path).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)))
}

/// The scenes of a folder, by file name.
fn all_in(folder: &str) -> Vec<(String, Scene)> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(scenes().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .collect();
    files.sort();
    let name = |path: &PathBuf| path.file_stem().unwrap().to_string_lossy().into_owned();
    files.iter().map(|path| (name(path), load(path))).collect()
}

#[test]
fn no_scene_draws_a_warning_and_no_title_is_used_twice() {
    let mut titles = Vec::new();
    for folder in ["", "paper/train", "paper/valid", "paper/test"] {
        for (name, scene) in all_in(folder) {
            assert!(scene.warning_report().is_none(), "{name}: {:?}", scene.warning_report());
            scene.solver().unwrap_or_else(|error| panic!("{name}: {error}"));
            titles.push(scene.title.clone());
        }
    }
    let all = titles.len();
    assert!(all >= 41);
    titles.sort();
    titles.dedup();
    assert_eq!(titles.len(), all);
}

#[test]
fn the_demo_takes_about_a_minute_on_two_cores() {
    let scene = load(&scenes().join("column.toml"));
    let needs = Needs::of(&scene, &Rates::of_processor(1.0e8));
    assert_eq!(needs.points, 1024);
    assert!((30.0..90.0).contains(&needs.seconds), "{}", needs.seconds);
    assert_eq!(needs.warnings, Vec::<String>::new());
    let twin = load(&scenes().join("column-mu-i.toml"));
    assert!(Needs::of(&twin, &Rates::of_processor(1.0e8)).seconds < 5.0);
    assert_eq!((twin.columns, twin.domain.size), (scene.columns, scene.domain.size));
}

#[test]
fn training_and_validation_are_those_of_the_paper() {
    let (train, valid) = (all_in("paper/train"), all_in("paper/valid"));
    assert_eq!((train.len(), valid.len()), (25, 5));
    for (name, scene) in train.iter().chain(&valid) {
        assert_eq!(scene.point_count(), 2304, "{name}");
        assert_eq!((scene.steps(), scene.steps_per_frame()), (30_000, 100), "{name}");
        assert_eq!(scene.domain.size, [10.0, 10.0], "{name}");
    }
    for (name, scene) in &train {
        let column = scene.columns[0];
        let ([x, y], [u, v]) = (column.place.corner, column.velocity);
        assert_eq!(*name, format!("x{x}y{y}-v{u}{v}"));
        assert!([x, y].iter().all(|x| [0.0, 1.0, 2.0, 3.0].contains(x)));
        assert!([u, v].iter().all(|u| [0.0, 5.0].contains(u)));
    }
    let starts: Vec<_> =
        valid.iter().map(|(_, s)| (s.columns[0].place.corner, s.columns[0].velocity)).collect();
    assert_eq!(
        starts,
        [
            ([1.5, 0.0], [0.0, 0.0]),
            ([2.5, 1.5], [0.0, 0.0]),
            ([3.5, 2.0], [0.0, 5.0]),
            ([1.5, 3.0], [2.5, 2.5]),
            ([1.5, 3.0], [5.0, 0.0]),
        ]
    );
}

#[test]
fn tests_have_the_points_and_steps_of_the_paper() {
    let expected = [
        ("col10x2", 5120, 30_000),
        ("col2x2", 1024, 30_000),
        ("col2x2twins", 2048, 30_000),
        ("col3x3barriers", 2304, 30_000),
        ("col5x2", 2560, 30_000),
        ("col5x3", 3840, 30_000),
        ("col5x4", 5120, 50_000),
        ("col5x5", 6400, 50_000),
        // 40 000 steps of settling and 50 000 of pushing.
        ("penetration", 5120, 90_000),
    ];
    let found = all_in("paper/test");
    let found: Vec<_> =
        found.iter().map(|(name, s)| (name.as_str(), s.point_count(), s.steps())).collect();
    assert_eq!(found, expected);
}

#[test]
fn all_runs_of_the_paper_have_one_material_and_one_packing() {
    let all: Vec<_> = ["train", "valid", "test"]
        .iter()
        .flat_map(|folder| all_in(&format!("paper/{folder}")))
        .collect();
    // All but the room that a GPU gives to neighbours, which changes no result.
    let material = |scene: &Scene| match &scene.material {
        Material::Rve(rve) => Rve { neighbours: Room::Usual, ..rve.clone() },
        Material::Discs(_) | Material::MuI(_) | Material::Elastic(_) => panic!("no packings"),
    };
    let first = &all[0].1;
    for (name, scene) in &all {
        assert_eq!(material(scene), material(first), "{name}");
        assert_eq!(scene.seed, first.seed, "{name}");
        assert_eq!(scene.numerics, first.numerics, "{name}");
        assert_eq!(scene.domain.walls, first.domain.walls, "{name}");
    }
}
