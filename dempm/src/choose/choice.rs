//! The cheapest model that is near enough to the truth.

use std::path::Path;

use serde::Serialize;
use toml::{Table, Value};

use super::candidate::{Candidate, candidates};
use super::error_model::{ErrorModel, Expected, Prediction};
use super::family::Family;
use super::features::{Features, features};
use super::learned::Learned;
use super::within::Within;
use crate::check::{Needs, Rates, bytes, quantity};
use crate::scene::{Chosen, Scene};
use crate::trajectory::Trajectory;

/// Why nothing can be chosen.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum ChoiceError {
    /// No candidate fits the scene.
    #[error("{name}: no model can be chosen for {why}")]
    NoCandidate {
        /// Name of the scene.
        name: String,
        /// What it has.
        why: &'static str,
    },
    /// The accuracy is a share of what does not exist.
    #[error("{name}: no run-out is expected, of which --within is a share")]
    #[diagnostic(help("give metres, such as --within 0.1"))]
    NoRunout {
        /// Name of the scene.
        name: String,
    },
    /// None of the candidates can be computed.
    #[error("{name}: none of the candidates can be computed: {why}")]
    NothingFits {
        /// Name of the scene.
        name: String,
        /// What is wrong with the first.
        why: String,
    },
}

/// All candidates of a scene, and the one that is taken.
#[derive(Clone, Debug, Serialize)]
pub struct Choice {
    /// Name of the scene.
    pub scene: String,
    /// The distance (m) from the truth that is allowed.
    pub within: f64,
    /// Expected way of the front (m); `None` without gravity or where it has no room.
    pub runout: Option<f64>,
    /// What the expected errors rest on.
    pub measured: String,
    /// Ways in which the scene lies outside of what was measured.
    pub beyond: Vec<&'static str>,
    /// All candidates.
    pub candidates: Vec<Entry>,
    /// Index of the one that is taken: the cheapest whose bound is within; else the nearest; outside of what was
    /// measured the finest.
    pub taken: usize,
    /// Whether its bound is within.
    pub met: bool,
}

/// A candidate with its expected error and cost.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub family: Family,
    /// What is expected of its distance from the truth; `None` if nothing like it was measured.
    pub prediction: Option<Prediction>,
    /// Estimated wall time (s), with preparation.
    pub seconds: Option<f64>,
    /// Memory (bytes).
    pub memory: Option<f64>,
    /// Why it is not near enough or cannot be computed.
    pub out: Option<String>,
    /// The largest distance to expect; `None` outside of what was measured.
    #[serde(skip)]
    expected: Option<Expected>,
    #[serde(skip)]
    candidate: Candidate,
    #[serde(skip)]
    features: Features,
}

impl Choice {
    /// Chooses a model of `scene` on a machine of this speed with so much memory left (bytes), with a learned one among
    /// the candidates if there is one.
    ///
    /// # Errors
    /// If the scene has no grains or a plate, no candidate can be computed, or a share of no run-out is asked for.
    pub fn of(
        scene: &Scene,
        within: Within,
        model: &ErrorModel,
        rates: &Rates,
        available: Option<f64>,
        learned: Option<&Learned>,
    ) -> Result<Self, ChoiceError> {
        let name = || scene.name.clone();
        let none = |why| Err(ChoiceError::NoCandidate { name: name(), why });
        if scene.plate.is_some() {
            return none("a moving plate");
        }
        if scene.material.name() == "elastic" {
            return none("an elastic material");
        }
        if scene.gravity[0] != 0.0 || scene.gravity[1] >= 0.0 {
            return none("gravity that does not act downwards");
        }
        let all = candidates(scene);
        // The grains of the truth, which a law does not have.
        let discs = all.first().and_then(|discs| discs.scene.as_deref().ok());
        let truth = discs.unwrap_or(scene).clone();
        let runout = runout(&truth, &Needs::of(&truth, rates));
        let within = within.metres(runout).ok_or_else(|| ChoiceError::NoRunout { name: name() })?;
        let height = scene.height();
        let simulated = |candidate| Entry::simulated(candidate, &truth, height, model, rates);
        let mut entries: Vec<Entry> = all.into_iter().map(simulated).collect();
        // What the scene itself lies outside of, every candidate does.
        let beyond: Vec<&'static str> = entries
            .first()
            .and_then(|discs| discs.prediction.as_ref())
            .map_or(Vec::new(), |prediction| prediction.beyond.clone());
        let is_measured = beyond.is_empty();
        entries.iter_mut().for_each(|entry| entry.expect(is_measured));
        entries.extend(learned.map(|learned| Entry::learned(learned, &truth)));
        for entry in &mut entries {
            entry.refuse_beyond(available);
        }
        let possible: Vec<bool> = entries.iter().map(|entry| entry.out.is_none()).collect();
        for entry in entries.iter_mut().filter(|entry| entry.out.is_none()) {
            entry.out = entry.why_not(within, is_measured);
        }
        let fits = |k: &usize| entries[*k].out.is_none();
        let time = |k: &usize| entries[*k].seconds.unwrap_or(f64::INFINITY);
        let bound = |k: &usize| entries[*k].bound().unwrap_or(f64::INFINITY);
        let every = || (0..entries.len()).filter(|k| possible[*k]);
        let cheapest = every().filter(fits).min_by(|a, b| time(a).total_cmp(&time(b)));
        let nearest = if is_measured {
            every().min_by(|a, b| bound(a).total_cmp(&bound(b)))
        } else {
            every().next()
        };
        let Some(taken) = cheapest.or(nearest) else {
            let why = entries.iter().find_map(|entry| entry.out.clone()).unwrap_or_default();
            return Err(ChoiceError::NothingFits { name: name(), why });
        };
        Ok(Self {
            scene: name(),
            within,
            runout,
            measured: model.source.clone(),
            beyond,
            met: fits(&taken),
            candidates: entries,
            taken,
        })
    }

    /// The candidate that is taken.
    pub fn taken(&self) -> &Entry {
        &self.candidates[self.taken]
    }

    /// The scene with the candidate that is taken, which states the choice.
    ///
    /// # Errors
    /// A sentence, if the scene with its statement is not valid.
    pub fn chosen_scene(&self) -> Result<Scene, String> {
        self.scene_of(self.taken())
    }

    /// The scene with a candidate, which states the choice.
    fn scene_of(&self, entry: &Entry) -> Result<Scene, String> {
        let scene = entry.candidate.scene.as_ref().map_err(Clone::clone)?;
        let mut table: Table = scene.text.parse().map_err(|error| format!("{error}"))?;
        let chosen = Chosen {
            model: entry.name.clone(),
            within: self.within,
            expected: entry.expected.map(|expected| expected.median),
            bound: entry.bound(),
        };
        let statement = Table::try_from(&chosen).map_err(|error| error.to_string())?;
        table.insert("choice".to_owned(), Value::Table(statement));
        let text = toml::to_string(&table).map_err(|error| error.to_string())?;
        Scene::parse(&text, &scene.name).map_err(|error| error.to_string())
    }

    /// The choice with the candidate whose scene has this text, such as that of a run to be continued; `None` if none
    /// has it.
    fn with_text(&self, text: &str) -> Option<Self> {
        let has = |entry: &Entry| self.scene_of(entry).is_ok_and(|scene| scene.text == text);
        let taken = self.candidates.iter().position(has)?;
        Some(Self { taken, met: self.candidates[taken].out.is_none(), ..self.clone() })
    }

    /// The choice of a run that is to be continued, if the trajectory at `output` was begun with one of the candidates;
    /// else the choice itself.
    pub fn continued(self, output: &Path) -> Self {
        let begun = Trajectory::open(output).ok();
        let same = begun.and_then(|begun| self.with_text(&begun.header().scene));
        same.unwrap_or(self)
    }

    /// The scene of the next coarser candidate, whose distance from the one that is taken shows its error, and the
    /// features of that.
    pub fn coarser(&self) -> Option<(&Scene, &Features)> {
        let all: Vec<Candidate> =
            self.candidates.iter().map(|entry| entry.candidate.clone()).collect();
        let coarser = self.taken().candidate.coarser(&all)?;
        let entry = self.candidates.iter().find(|entry| entry.name == coarser.name)?;
        Some((entry.candidate.scene.as_deref().ok()?, &self.taken().features))
    }
}

impl Entry {
    /// The scene with this candidate, without a statement of the choice.
    ///
    /// # Errors
    /// Why it cannot be computed so.
    pub fn scene(&self) -> Result<&Scene, &str> {
        self.candidate.scene.as_deref().map_err(String::as_str)
    }

    /// Nine of ten largest distances are smaller (m).
    pub fn bound(&self) -> Option<f64> {
        self.expected.map(|expected| expected.bound)
    }

    /// The largest distance to expect, if the scene and this candidate are like what was measured.
    pub fn expected(&self) -> Option<Expected> {
        self.expected
    }

    /// A candidate that is simulated, on a scene of this height (m) whose grains are those of `truth`.
    fn simulated(
        candidate: Candidate,
        truth: &Scene,
        height: f64,
        model: &ErrorModel,
        rates: &Rates,
    ) -> Self {
        let features = features(truth, &candidate);
        let needs = candidate.scene.as_deref().ok().map(|scene| Needs::of(scene, rates));
        Self {
            name: candidate.name.clone(),
            family: candidate.family,
            prediction: model.predict(candidate.family, &features, height),
            expected: None,
            seconds: needs.as_ref().map(|needs| needs.seconds + needs.preparation),
            memory: needs.as_ref().map(|needs| needs.memory),
            out: candidate.scene.as_ref().err().cloned(),
            candidate,
            features,
        }
    }

    /// A learned model, which knows itself what it was measured on.
    fn learned(learned: &Learned, truth: &Scene) -> Self {
        let candidate = learned.candidate(&truth.name);
        let wrong = candidate.scene.as_ref().err().cloned();
        let prediction = learned.prediction();
        Self {
            name: candidate.name.clone(),
            family: candidate.family,
            expected: prediction.as_ref().map(|prediction| prediction.largest),
            prediction,
            seconds: learned.seconds,
            memory: learned.memory,
            out: learned.out.clone().or(wrong),
            features: features(truth, &candidate),
            candidate,
        }
    }

    /// Expects what is predicted, unless that lies outside of what was measured.
    fn expect(&mut self, is_measured: bool) {
        let prediction = self.prediction.as_ref().filter(|_| is_measured);
        self.expected = prediction
            .filter(|prediction| prediction.beyond.is_empty())
            .map(|prediction| prediction.largest);
    }

    /// Leaves it out if it needs more memory than is available (bytes).
    fn refuse_beyond(&mut self, available: Option<f64>) {
        let memory = self.memory.filter(|memory| available.is_some_and(|left| *memory > left));
        if let Some(memory) = memory.filter(|_| self.out.is_none()) {
            self.out = Some(format!("needs {}, more than is left", bytes(memory)));
        }
    }

    fn why_not(&self, within: f64, is_measured: bool) -> Option<String> {
        let Some(expected) = self.expected else {
            let beyond = self.prediction.as_ref().map(|prediction| prediction.beyond.join(", "));
            return Some(match beyond {
                Some(_) if !is_measured => "the scene is unlike all that were measured".to_owned(),
                Some(beyond) => format!("not measured: {beyond}"),
                None => "not measured".to_owned(),
            });
        };
        (expected.bound > within).then(|| format!("its bound is above {}", quantity(within, "m")))
    }
}

/// How far the front is expected to move (m), up to the walls.
fn runout(scene: &Scene, needs: &Needs) -> Option<f64> {
    let [left, right] = needs.reach?;
    let start = scene.columns.iter().map(|column| column.place.corner[0]).fold(f64::MAX, f64::min);
    let end = scene.columns.iter().map(|column| column.place.end()[0]).fold(f64::MIN, f64::max);
    let runout = (right.min(scene.domain.size[0]) - end).max(start - left.max(0.0));
    (runout > 0.0).then_some(runout)
}

#[cfg(test)]
mod tests {
    use super::super::learned::LearnedError;
    use super::super::library::{Case, Distance};
    use super::*;

    fn scene(size: [f64; 2], bottom: f64, lines: &str) -> Scene {
        let text = format!(
            "duration = 0.5\nmaterial.kind = \"discs\"\n[domain]\nsize = [4.0, 4.0]\n[[column]]\n\
             corner = [0.0, {bottom:?}]\nsize = {size:?}\n{lines}"
        );
        Scene::parse(&text, "test.toml").unwrap()
    }

    /// Errors of a hundredth of the height for discs, more for larger ones, packings and the law by their cells.
    fn model() -> ErrorModel {
        let mut cases = Vec::new();
        for k in 0..18 {
            let size = [[0.5, 1.0, 1.5][k % 3], [0.5, 1.0, 2.0][k / 3 % 3]];
            let scene = scene(size, [0.0, 0.5][k / 9], "");
            for candidate in candidates(&scene) {
                let fineness = candidate.cell / (size[1] / 16.0);
                let share = match candidate.family {
                    Family::Discs => 0.01 * candidate.size,
                    Family::Rve => 0.03 * fineness,
                    Family::MuI => 0.08 * fineness,
                    Family::Learned => unreachable!("no network is among them"),
                };
                let error = share * size[1];
                cases.push(Case {
                    scene: format!("{k}"),
                    candidate: candidate.name.clone(),
                    family: candidate.family,
                    features: features(&scene, &candidate),
                    height: size[1],
                    distance: Some(Distance { end: error, largest: error }),
                    change: None,
                    seconds: [1.0, 0.0],
                    failure: String::new(),
                });
            }
        }
        ErrorModel::fit(&cases, "18 scenes".to_owned()).unwrap()
    }

    fn choose(scene: &Scene, within: f64, available: Option<f64>) -> Choice {
        let rates = Rates::of_processor(1.0e8);
        Choice::of(scene, Within::Metres(within), &model(), &rates, available, None).unwrap()
    }

    #[test]
    fn the_cheapest_that_is_near_enough_is_taken() {
        let column = scene([1.0, 1.0], 0.0, "");
        for (within, name, met) in
            [(1.0, "mu(I), cells of 125 mm", true), (0.012, "discs", true), (0.001, "discs", false)]
        {
            let choice = choose(&column, within, None);
            assert_eq!((choice.taken().name.as_str(), choice.met), (name, met), "{choice}");
            let taken = choice.taken().seconds;
            let near = choice.candidates.iter().filter(|entry| entry.out.is_none());
            assert!(near.into_iter().all(|entry| taken <= entry.seconds));
        }
        // 18 000 discs take 27 MB.
        let choice = choose(&column, 0.012, Some(2.0e7));
        assert_ne!(choice.taken().name, "discs");
        assert!(choice.candidates[0].out.as_ref().unwrap().contains("more than is left"));
    }

    #[test]
    fn scenes_unlike_all_others_get_the_finest_without_a_bound() {
        let choice = choose(&scene([1.0, 1.0], 0.0, "velocity = [3.0, 0.0]"), 1.0, None);
        assert_eq!(choice.beyond, ["speed of the throw"]);
        assert_eq!((choice.taken, choice.met), (0, false));
        let chosen = choice.chosen_scene().unwrap().choice.unwrap();
        assert_eq!((chosen.expected, chosen.bound), (None, None));
        assert!(choice.verdict().contains("speed of the throw"));
    }

    #[test]
    fn a_network_counts_by_its_own_bound() {
        let rates = Rates::of_processor(1.0e8);
        let of = |velocity: &str, learned: &Learned| {
            let scene = scene([1.0, 1.0], 0.0, velocity);
            let learned = Learned { scene: scene.text.clone(), ..learned.clone() };
            let within = Within::Metres(0.05);
            Choice::of(&scene, within, &model(), &rates, None, Some(&learned)).unwrap()
        };
        let expected = Expected { median: 0.02, bound: 0.04 };
        let quick = Learned {
            name: "network".to_owned(),
            scene: String::new(),
            frame_interval: 0.02,
            error: Some(LearnedError { end: expected, largest: expected }),
            seconds: Some(1.0e-6),
            memory: None,
            out: None,
        };
        let throw = "velocity = [3.0, 0.0]";
        for velocity in ["", throw] {
            let choice = of(velocity, &quick);
            assert_eq!((choice.taken().family, choice.met), (Family::Learned, true), "{choice}");
            assert_eq!(choice.chosen_scene().unwrap().choice.unwrap().bound, Some(0.04));
            assert!(choice.coarser().is_none());
        }
        // Too slow, too far, or out by its own word.
        let slow = Learned { seconds: Some(1.0e9), ..quick.clone() };
        let beyond =
            Some(LearnedError { end: expected, largest: Expected { bound: 0.06, ..expected } });
        let far = Learned { error: beyond, ..quick.clone() };
        let out = Learned { out: Some("other frames".to_owned()), ..quick.clone() };
        assert_ne!(of("", &slow).taken().family, Family::Learned);
        assert_eq!(of(throw, &far).taken, 0);
        let choice = of(throw, &out);
        let network = choice.candidates.last().unwrap();
        assert_eq!((choice.taken, network.out.as_deref()), (0, Some("other frames")));
        assert_eq!(quick.clone().with_frames(0.02).out, None);
        assert!(quick.with_frames(0.01).out.unwrap().contains("those of the data set 0.01 s"));
    }

    #[test]
    fn the_scene_states_the_choice_and_is_found_again() {
        let column = scene([1.0, 1.0], 0.0, "");
        let choice = choose(&column, 0.1, None);
        let scene = choice.chosen_scene().unwrap();
        let chosen = scene.choice.as_ref().unwrap();
        assert_eq!((chosen.within, &chosen.model), (0.1, &choice.taken().name));
        assert_eq!(chosen.bound, choice.taken().bound());
        // As if the machine had become faster at something else meanwhile.
        let other = Choice { taken: 0, ..choice.clone() };
        assert_eq!(other.with_text(&scene.text).unwrap().taken, choice.taken);
        assert!(other.with_text("duration = 1.0").is_none());
    }

    #[test]
    fn a_share_is_one_of_the_way_to_the_wall() {
        let rates = Rates::of_processor(1.0e8);
        let of =
            |scene: &Scene| Choice::of(scene, Within::OfRunout(0.1), &model(), &rates, None, None);
        // 2.5 a L = 2.5 m for discs (Staron and Hinch 2005).
        assert!((of(&scene([1.0, 1.0], 0.0, "")).unwrap().within - 0.25).abs() < 1e-12);
        // The box ends after 2 m.
        assert!((of(&scene([2.0, 2.0], 0.0, "")).unwrap().within - 0.2).abs() < 1e-12);
        let full = of(&scene([4.0, 1.0], 0.0, ""));
        assert!(matches!(full, Err(ChoiceError::NoRunout { .. })));
    }

    #[test]
    fn scenes_without_grains_have_no_choice() {
        let text = "duration = 0.5\nmaterial.kind = \"elastic\"\n[domain]\nsize = [4.0, 2.0]\n[[column]]\nsize = [1.0, 1.0]\n";
        let scene = Scene::parse(text, "test.toml").unwrap();
        let found = Choice::of(
            &scene,
            Within::Metres(0.1),
            &model(),
            &Rates::of_processor(1e8),
            None,
            None,
        );
        assert!(found.unwrap_err().to_string().contains("elastic"));
    }
}
