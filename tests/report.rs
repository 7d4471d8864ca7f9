//! `validation` as a user meets it: a report in one command with a page, tables, figures and numbers; comparisons; the
//! table of measured errors.

use std::cell::RefCell;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use assert_cmd::cargo::cargo_bin;
use dempm::check::Rates;
use dempm::scene::Scene;
use dempm::simulation::Simulation;
use dempm::trajectory::TrajectoryWriter;
use files::Interrupt;
use serde_json::Value;
use surrogate::features::Normalisation;
use surrogate::network::burn_backend::{Cpu, device};
use surrogate::network::{Model, ModelConfig, weights};
use tempfile::TempDir;
use validation::context::Context;
use validation::progress::Progress;
use validation::render::block::Block;
use validation::render::sections::truth_blocks;
use validation::run_cache::RunCache;
use validation::studies::sweep::{Case, Family, Kind, TruthScene};
use validation::suite::Suite;

/// All sections that take data and models, and none that computes for long.
const PAPER: &str = "table 6,table 7,tables 2,fig.,stated,runs behind";

fn report_command(directory: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(cargo_bin("validation"));
    // Between fork and exec a child of another test holds the lock of a file being written here.
    command.current_dir(directory).env("HDF5_USE_FILE_LOCKING", "FALSE");
    command.arg("report").args(arguments);
    command
}

fn report(directory: &Path, arguments: &[&str]) -> Output {
    report_command(directory, arguments).output().unwrap()
}

/// A report on the fixture that has to succeed.
fn report_on_fixture(directory: &Path) -> PathBuf {
    fixture(directory);
    let arguments = ["--data", "data", "--models", "models", "--only", PAPER, "-o", "out"];
    let output = report(directory, &arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    directory.join("out")
}

/// Trajectories of 24 points under names of the paper, and a model that has learnt nothing.
fn fixture(directory: &Path) {
    for (name, x) in [("test/col2x2", 0.0), ("valid/case1", 0.375), ("train/x0y0-v00", 0.0)] {
        let scene = format!(
            "title = \"Tiny column\"\nduration = 0.2\nframe_interval = 0.01\n\
             [domain]\nsize = [1.0, 0.5]\ncell = 0.125\n\
             [[column]]\ncorner = [{x:?}, 0.0]\nsize = [0.25, 0.375]\n\
             [material]\nkind = \"mu-i\"\n[output]\nfields = []\n"
        );
        let mut simulation = Simulation::new(Scene::parse(&scene, "tiny.toml").unwrap()).unwrap();
        let path = directory.join("data").join(name).with_extension("h5");
        let header = simulation.header("2026-11-21T00:00:00Z".to_owned());
        let points = simulation.static_points();
        let mut writer = TrajectoryWriter::create(&path, &header, &points).unwrap();
        writer.push(simulation.frame()).unwrap();
        for _ in 0..simulation.scene.frames() {
            for _ in 0..simulation.scene.steps_per_frame() {
                simulation.advance().unwrap();
            }
            writer.push(simulation.frame()).unwrap();
        }
        writer.set_wall_time("preparation", 100.0);
        writer.set_wall_time("rve", 3.0);
        writer.set_wall_time("mpm", 0.25);
        writer.finish("finished").unwrap();
    }
    let config = ModelConfig {
        width: 8,
        hidden_layers: 1,
        message_layers: 0,
        frames: 3,
        connection_radius: 0.13,
        ..ModelConfig::default()
    };
    let normalisation = Normalisation::about_zero(2, 1e-3, 1e-6);
    let models = directory.join("models");
    std::fs::create_dir_all(models.join("baseline.stages")).unwrap();
    for (path, steps, seed) in
        [("baseline.safetensors", 1000, 1), ("baseline.stages/early.safetensors", 500, 2)]
    {
        let training = format!(
            "{{ \"frame_interval\": 0.01, \"without_gravity\": false, \"steps\": {steps} }}"
        );
        let extra = [("training".to_owned(), training)].into();
        let model: Model<Cpu> = Model::new(&config, seed, &device());
        weights::save(&models.join(path), &model, &config, &normalisation, extra).unwrap();
    }
    let cost = "data_seconds = 5.0\ntraining_seconds = 20.0\ndevice = \"a test\"\n";
    std::fs::write(models.join("baseline.cost.toml"), cost).unwrap();
    std::fs::write(models.join("baseline.log.csv"), "step,loss,rate\n1,1.0,1e-4\n9,0.5,1e-4\n")
        .unwrap();
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The row of a table that begins so.
fn row(csv: &str, start: &str) -> Vec<String> {
    let line = csv.lines().find(|line| line.starts_with(start)).unwrap();
    line.split(',').map(str::to_owned).collect()
}

/// The section of a page whose name begins so.
fn section<'p>(page: &'p str, name: &str) -> &'p str {
    let from = &page[page.find(&format!("<section id=\"{name}")).unwrap()..];
    &from[..from.find("</section>").unwrap()]
}

/// The sections of the chapter about the paper.
fn paper_sections(results: &Value) -> &Value {
    let mut chapters = results["chapters"].as_array().unwrap().iter();
    &chapters.find(|chapter| chapter["title"] == "The paper, side by side").unwrap()["sections"]
}

#[test]
fn models_are_compared_with_discs() {
    let directory = TempDir::new().unwrap();
    let scene: &TruthScene = Box::leak(Box::new(TruthScene {
        name: "Tiny",
        lead: "A tiny column.",
        title: "Truth: Tiny",
        description: "a tiny column collapses",
        text: "duration = 0.1\n[domain]\nsize = [1.0, 0.5]\n[[column]]\nsize = [0.125, 0.25]\n\
               [material]\nkind = \"rve\"\n",
        published: None,
        size: [0.125, 0.25],
        kind: Kind::Column,
    }));
    let program = cargo_bin("validation");
    let work = directory.path().join("work");
    let mut context = Context {
        suite: Suite::Quick,
        device: "cpu".to_owned(),
        device_name: "cpu".to_owned(),
        cache: RunCache::open(&work, program.clone(), false, Interrupt::default()).unwrap(),
        progress: Progress::hidden(),
        data: None,
        models: Vec::new(),
        runs: Vec::new(),
        rates: Rates::of_processor(1e7),
        hashes: RefCell::default(),
    };
    let case = Case::new(scene, Suite::Quick);
    assert!(!case.missing(&context).is_empty());
    let blocks = truth_blocks(&case, &mut context).unwrap();
    assert!(case.missing(&context).is_empty());
    let runs = context.cache.take_used().len();

    let sweep = case.measure(&mut context).unwrap();
    assert_eq!((sweep.measured.len(), sweep.seeds), (5, 4));
    for m in &sweep.measured {
        assert_eq!(m.failure, "", "{}", m.name);
        let worst = m.comparison.as_ref().unwrap().worst().unwrap();
        // One seed of the discs is as far from the others as they are from each other.
        let most = if m.family == Family::Discs { 3.0 } else { 100.0 };
        assert!((0.3..most).contains(&worst.ratio().unwrap()), "{}: {worst:?}", m.name);
    }
    // What was computed is used again, also of brief runs that were repeated.
    assert!(runs >= context.cache.take_used().len());
    let figures = blocks.iter().filter(|block| matches!(block, Block::Figure(_))).count();
    let tables = blocks.iter().filter(|block| matches!(block, Block::Table(_))).count();
    // An animation, and quantities over time.
    assert!(figures >= 6 && tables == 3, "{figures} figures, {tables} tables");

    // The same from the command line.
    let [packings, truth] = case.drawn(&mut context).unwrap().unwrap();
    let compare = |more: &str| {
        let mut command = Command::new(&program);
        command.arg("compare").arg(&packings.output).arg("--truth").arg(&truth.output).arg(more);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let text = compare("--times=0.04,0.1");
    assert!(text.starts_with("Truth: discs, seeds 1."), "{text}");
    assert_eq!(text.lines().filter(|line| line.contains("trajectory.h5")).count(), 3, "{text}");
    let found: Value = serde_json::from_str(&compare("--json")).unwrap();
    assert_eq!((&found["truth"], &found["seeds"]), (&"discs".into(), &serde_json::json!([1])));
    assert_eq!(found["runs"][0]["rows"].as_array().unwrap().len(), 5);
}

#[test]
fn runs_are_compared() {
    let directory = TempDir::new().unwrap();
    fixture(directory.path());
    let compare_with = |run: &str, more: &[&str]| {
        let mut command = Command::new(cargo_bin("validation"));
        command.current_dir(directory.path().join("data"));
        command.args(["compare", "test/col2x2.h5", run]).args(more).output().unwrap()
    };
    let compare = |run: &str| compare_with(run, &[]);
    let cells = |run: &str| -> Vec<Vec<f64>> {
        let output = compare(run);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).unwrap();
        let rows = text.lines().filter(|line| line.starts_with("| ") && line.contains(run));
        rows.map(|row| row.split('|').filter_map(|cell| cell.trim().parse().ok()).collect())
            .collect()
    };
    // The same scene: no difference after the time in the first column. At five times.
    let same = cells("train/x0y0-v00.h5");
    assert_eq!(same.len(), 5);
    assert!(same.iter().all(|row| row.len() == 7 && row[1..].iter().all(|&x| x == 0.0)));
    // The same column 0.375 m to the right, in a box of 1 m: at first it has only been moved.
    let [time, distance, front, mass_front, ..] = cells("valid/case1.h5")[0][..] else {
        panic!("an empty row")
    };
    assert_eq!(time, 0.02);
    assert!((distance - 0.375).abs() < 1e-3 && (front - 0.375).abs() < 1e-3);
    assert!((mass_front - 0.375).abs() < 1e-3);

    let said = String::from_utf8(compare("valid/case1.h5").stdout).unwrap();
    assert!(said.contains("valid/case1.h5: 24 points, one by one."), "{said}");
    // All frames but the first, which is given.
    let json = compare_with("valid/case1.h5", &["--json"]).stdout;
    let json: Value = serde_json::from_slice(&json).unwrap();
    let run = &json["runs"][0];
    assert_eq!((&run["parts"], &run["one_by_one"]), (&24.into(), &true.into()));
    assert_eq!(run["rows"].as_array().unwrap().len(), 20);
    assert!((run["rows"][0]["distance"].as_f64().unwrap() - 0.375).abs() < 1e-3);

    let wrong = compare("no.h5");
    assert!(!wrong.status.success());
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("no.h5"));
}

#[test]
fn a_report_has_a_page_tables_figures_and_numbers() {
    let directory = TempDir::new().unwrap();
    let out = report_on_fixture(directory.path());
    let page = read(&out.join("index.html"));
    assert!(!page.contains("not computed yet"));
    // What came out stands before everything else.
    let first = &page[..page.find("<nav>").unwrap()];
    let lead = first.find("class=\"leads\"").unwrap();
    assert!(first[lead..].contains("#accuracy-stated-in-the-paper-s-text"), "{first}");
    assert_eq!(first.matches("data:image/gif").count(), 1, "one animation");
    // Sections are folded, each with a lead.
    let sections = page.matches("<section id=").count();
    assert_eq!(page.matches("<details><summary><h3>").count(), sections);
    assert!(!page.contains("</h3><p></p>"));
    for curve in ["loss", "validation-error"] {
        let file = format!(
            "figures/fig-8-training-curves--{curve}-over-training-steps-the-paper-s-networks.svg"
        );
        assert!(out.join(&file).is_file(), "{file}");
    }

    // Every table and figure has a file, and every file a place in the page.
    let mut linked = HashSet::new();
    for link in page.split("href=\"").skip(1).map(|rest| rest.split('"').next().unwrap()) {
        if !link.starts_with('#') {
            assert!(out.join(link).is_file(), "{link}");
            linked.insert(out.join(link));
        }
    }
    for folder in ["tables", "figures"] {
        for file in std::fs::read_dir(out.join(folder)).unwrap() {
            assert!(linked.remove(&file.as_ref().unwrap().path()), "{file:?}");
        }
    }
    assert!(linked.is_empty());

    // Paper, ours, ratio; preparation does not count; what is absent stays empty.
    let times = read(&out.join("tables/table-7-wall-times-of-the-test-set--direct-solver.csv"));
    // The fixture has other points and steps than the paper, so no ratio.
    let expected = ["1024", "24", "30000", "2000", "325", "3.25", ""];
    assert_eq!(row(&times, "col2x2,")[1..8], expected);
    assert_eq!(row(&times, "col5x5,")[6..9], ["", "", ""]);
    let networks = read(&out.join("tables/table-6-networks--networks-of-the-paper.csv"));
    let expected = ["1425282", "1425282", "1", "70.5", "20", "0.284", "a test"];
    assert_eq!(row(&networks, "baseline,")[1..], expected);

    let results: Value = serde_json::from_str(&read(&out.join("results.json"))).unwrap();
    assert!(results["report"]["device"].is_string());
    let runs = results["runs"].as_array().unwrap();
    // Two rollouts of each of the two cases that need them: as it is, and with mirror images averaged;
    // one for its time, and one of the weights half way and of the last, for the curve.
    assert_eq!(runs.len(), 7);
    assert!(runs[0]["command"].as_str().unwrap().starts_with("surrogate rollout "));
    assert_eq!(runs[0]["about"]["seed"], 1);
    assert!(runs[0]["about"]["versions"]["surrogate"].is_string());
    let sections = paper_sections(&results).as_array().unwrap();
    assert!(sections.iter().all(|section| section["state"] == "done"));
    let missing = paper_sections(&results).to_string();
    assert!(missing.contains("no such trajectory in `test/`"), "{missing}");
}

#[test]
fn what_has_been_run_is_used_again() {
    let directory = TempDir::new().unwrap();
    let out = report_on_fixture(directory.path());
    let runs = directory.path().join("out-work/runs");
    let times = || -> Vec<_> {
        let entries = std::fs::read_dir(&runs).unwrap().map(|entry| entry.unwrap().path());
        entries.map(|path| path.join("run.json").metadata().unwrap().modified().unwrap()).collect()
    };
    let (before, page) = (times(), read(&out.join("index.html")));
    std::fs::remove_dir_all(&out).unwrap();
    let arguments = ["--data", "data", "--models", "models", "--only", PAPER, "-o", "out"];
    assert!(report(directory.path(), &arguments).status.success());
    assert_eq!(times(), before);
    // All but the time of writing is the same.
    let body = |page: &str| page[..page.find("<section id=\"facts\">").unwrap()].to_owned();
    assert!(body(&read(&out.join("index.html"))) == body(&page));
}

#[test]
fn a_part_is_computed_anew_and_the_rest_stays() {
    let directory = TempDir::new().unwrap();
    let out = report_on_fixture(directory.path());
    let page = read(&out.join("index.html"));
    // Elsewhere the trajectories may not be there.
    std::fs::remove_dir_all(directory.path().join("data")).unwrap();
    std::fs::remove_dir_all(&out).unwrap();
    let cost = directory.path().join("models/baseline.cost.toml");
    std::fs::write(&cost, read(&cost).replace("20.0", "40.0")).unwrap();
    let note = ["--note", "Of `one` model."];
    let part = ["--models", "models", "--only", "table 6", "-o", "out"];
    let output = report(directory.path(), &[note.as_slice(), &part].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let networks = read(&out.join("tables/table-6-networks--networks-of-the-paper.csv"));
    assert_eq!(row(&networks, "baseline,")[5], "40");
    let anew = read(&out.join("index.html"));
    assert_eq!(section(&anew, "table-7"), section(&page, "table-7"));
    let first = &anew[..anew.find("<nav>").unwrap()];
    assert!(first.contains("Of <code>one</code> model."));
    assert_ne!(anew, page);
    // Commands of both, and the runs that the other sections rest on.
    let results: Value = serde_json::from_str(&read(&out.join("results.json"))).unwrap();
    assert_eq!(results["report"]["commands"].as_str().unwrap().lines().count(), 2);
    assert_eq!(results["runs"].as_array().unwrap().len(), 7);
}

#[test]
fn sections_stay_without_their_work_directory() {
    let directory = TempDir::new().unwrap();
    let out = report_on_fixture(directory.path());
    let before = section(&read(&out.join("index.html")), "fig-22").to_owned();
    std::fs::remove_dir_all(directory.path().join("out-work")).unwrap();
    std::fs::remove_dir_all(directory.path().join("data")).unwrap();
    let output =
        report(directory.path(), &["--models", "models", "--only", "table 6", "-o", "out"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(section(&read(&out.join("index.html")), "fig-22"), before);
}

#[test]
fn until_it_is_computed_anew_the_page_has_what_it_had() {
    let directory = TempDir::new().unwrap();
    let out = report_on_fixture(directory.path());
    std::fs::remove_dir_all(&out).unwrap();
    let arguments = ["--data", "data", "--models", "models", "--only", PAPER, "-o", "out"];
    let mut child = report_command(directory.path(), &arguments).spawn().unwrap();
    // The page is written whole or not at all, and first of all.
    let page = out.join("index.html");
    while !page.exists() {
        let ended = child.try_wait().unwrap().is_some();
        assert!(!ended || page.exists(), "no page");
    }
    let page = read(&page);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(page.contains("Fig. 22: penetration") && !page.contains("not computed yet"));
}

#[test]
fn a_damaged_file_fails_its_sections_and_only_those() {
    let directory = TempDir::new().unwrap();
    fixture(directory.path());
    std::fs::write(directory.path().join("data/test/col2x2.h5"), "no trajectory").unwrap();
    let arguments =
        ["--data", "data", "--models", "models", "--only", "table 6,table 7", "-o", "out"];
    let output = report(directory.path(), &arguments);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("Table 7"));
    let results = read(&directory.path().join("out/results.json"));
    let results: Value = serde_json::from_str(&results).unwrap();
    for section in paper_sections(&results).as_array().unwrap() {
        let failed = section["title"].as_str().unwrap().starts_with("Table 7");
        assert_eq!(section["state"] == "failed", failed, "{section}");
        assert!(!failed || section["blocks"].to_string().contains("col2x2.h5"));
    }
}

#[test]
fn a_folder_that_is_not_there_is_refused() {
    let directory = TempDir::new().unwrap();
    let output = report(directory.path(), &["--data", "nowhere"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("nowhere: there is no such folder"));
}

#[test]
fn a_report_does_not_go_into_the_folders_that_it_reads() {
    let directory = TempDir::new().unwrap();
    fixture(directory.path());
    for into in [["-o", "data"], ["-o", "models"], ["--work", "./data"]] {
        let given = ["--data", "data", "--models", "models", "--only", PAPER];
        let output = report(directory.path(), &[&given[..], &into].concat());
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{into:?}");
        assert!(error.contains("would replace its own input"), "{error}");
    }
}

#[test]
fn a_section_that_there_is_not_is_refused() {
    let directory = TempDir::new().unwrap();
    let output = report(directory.path(), &["--only", "table 7,scalling"]);
    assert_eq!(output.status.code(), Some(1));
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(error.contains("`scalling`") && error.contains("Table 7"), "{error}");
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0, "nothing is written");
}

/// Writes what a browser finds wrong with the page into the page itself, or into the page around it.
const INSPECTION: &str = "<script>
window.errors = [];
window.addEventListener('error', e => window.errors.push(String(e.message)));
window.addEventListener('load', () => {
  document.querySelectorAll('details').forEach(details => details.open = true);
  const broken = [...document.images].filter(image => !image.naturalWidth).length;
  const wide = document.documentElement.scrollWidth - window.innerWidth;
  const fetched = performance.getEntriesByType('resource').filter(e => !e.name.startsWith('data:'));
  const flat = [...document.querySelectorAll('svg')].filter(s => s.getBoundingClientRect().height < 50);
  const cut = [...document.querySelectorAll('.scroll')].filter(e => e.scrollWidth > e.clientWidth + 1);
  const found = `images ${document.images.length}, broken ${broken}, errors ${window.errors.length}, ` +
    `fetched ${fetched.length}, flat ${flat.length}, cut ${cut.length}, too wide ${wide > 0}`;
  document.documentElement.setAttribute('data-found', found);
  parent.postMessage(found, '*');
});
</script>";

/// A page as wide as a phone around the inspected one: a browser's window is wider.
const PHONE: &str = "<!doctype html><script>
addEventListener('message', e => document.documentElement.setAttribute('data-found', e.data));
</script><iframe src=\"inspected.html\" width=\"390\" height=\"844\"></iframe>";

#[test]
fn a_browser_finds_nothing_wrong_with_the_page() {
    let Some(browser) = ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| Command::new(name).arg("--version").output().is_ok())
    else {
        eprintln!("skipped: chromium is not installed");
        return;
    };
    let directory = TempDir::new().unwrap();
    let out = report_on_fixture(directory.path());
    let page = read(&out.join("index.html")).replacen("<head>", &format!("<head>{INSPECTION}"), 1);
    let inspected = out.join("inspected.html");
    std::fs::write(&inspected, page).unwrap();
    let phone = out.join("phone.html");
    std::fs::write(&phone, PHONE).unwrap();
    for (width, page) in [(390, &phone), (500, &inspected), (1280, &inspected)] {
        let profile = directory.path().join(format!("profile-{width}"));
        let output = Command::new(browser)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"])
            .args(["--disable-dev-shm-usage", "--host-resolver-rules=MAP * ~NOTFOUND"])
            .args(["--disable-background-networking", "--virtual-time-budget=10000"])
            .arg(format!("--window-size={},900", width.max(500)))
            .arg(format!("--user-data-dir={}", profile.display()))
            .arg(format!("file://{}", page.display()))
            .output()
            .unwrap();
        let dom = String::from_utf8_lossy(&output.stdout).into_owned();
        let found = dom.split("data-found=\"").nth(1).unwrap_or_else(|| {
            panic!("no inspection: {}", String::from_utf8_lossy(&output.stderr))
        });
        let found = found.split('"').next().unwrap();
        let expected = "images 5, broken 0, errors 0, fetched 0, flat 0, cut 0, too wide false";
        assert_eq!(found, expected, "at {width} pixels");
    }
}

/// The table of measured errors grows by the scenes of a further list, and keeps those that it has.
#[test]
fn scenes_of_lists_are_measured() {
    let directory = TempDir::new().unwrap();
    let at = |name: &str| directory.path().join(name);
    let scene = "duration = 0.05\nframe_interval = 0.025\noutput.fields = []\n\
                 [domain]\nsize = [3.0, 1.0]\ncell = 0.125\n[[column]]\nsize = [0.5, 0.5]\n\
                 [material]\nkind = \"discs\"\n[grains]\nradius_min = 1e-2\nradius_max = 2e-2\n";
    std::fs::write(at("scene.toml"), scene).unwrap();
    for (name, seed) in [("one.toml", 1), ("two.toml", 2)] {
        let list = format!(
            "scene = \"scene.toml\"\nseed = {seed}\n[[random]]\nclass = \"heap\"\ntrain = 1\ntest = 1\n\
             [random.draw]\ncolumn.0.size = [0.25, {{ choice = [0.25, 0.5] }}]\n"
        );
        std::fs::write(at(name), list).unwrap();
    }
    let measure = |lists: &[&str]| {
        let mut command = Command::new(cargo_bin("validation"));
        command.current_dir(directory.path()).env("DEMPM_CACHE_DIR", at("cache"));
        command.arg("library").args(lists);
        command.args(["-o", "table.csv", "--seeds", "2", "--device", "cpu", "-q"]).output().unwrap()
    };
    let table = || std::fs::read_to_string(at("table.csv")).unwrap();
    assert!(measure(&["one.toml"]).status.success());
    let one = table();
    assert!(measure(&["one.toml", "two.toml"]).status.success());
    let both = table();
    // Every row of the first is kept, wall times included, and the second list has as many.
    assert!(both.starts_with(&one));
    let of = |list: &str| both.lines().filter(|line| line.starts_with(list)).count();
    assert!(of("one/heap-000,") >= 4 && of("one/") == of("two/heap-000,"), "{both}");

    std::fs::create_dir(at("copy")).unwrap();
    for name in ["one.toml", "scene.toml"] {
        std::fs::copy(at(name), at("copy").join(name)).unwrap();
    }
    let output = measure(&["one.toml", "copy/one.toml"]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && message.contains("another list is called `one`"),
        "{message}"
    );
}
