//! A rollout beside its teacher, and its outcome.

use std::path::Path;
use std::sync::Arc;

use dempm::device::Device;
use dempm::scene::Scene;
use dempm::simulation::{Simulation, SimulationError};
use dempm::trajectory::{Frame, Header, Points};
use files::utc_now;
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use surrogate::diagnostics::{Monitor, start_checks};
use surrogate::evaluation::mean_square_distance;
use surrogate::rollout::{InitialFrames, Rollout, static_features_of};
use surrogate::simulator::Simulator;

use crate::models::is_of_discs;
use crate::studies::stability::outcome::Outcome;
use crate::studies::stability::scene_messages;
use crate::studies::stability::study::{Picture, StudyError};

/// Error, relative to the motion, above which a prediction is a failure.
pub const WRONG: f64 = 0.5;

pub type Frames = Vec<Vec<[f64; 2]>>;

/// What a network learnt from, which is its truth here.
pub struct Teacher {
    material: Material,
    /// Time between frames of the network, s.
    pub interval: f64,
    /// That of the network, on which discs are computed too.
    device: Option<Arc<gpu::Device>>,
}

enum Material {
    /// The continuum law, for networks that learnt from packings: it costs seconds.
    Law,
    /// Discs twice as large as the usual ones, within the range of the training: an eighth of the work.
    Discs,
}

impl Teacher {
    /// The teacher of a network.
    pub fn of(simulator: &Simulator) -> Self {
        let interval = simulator.training.frame_interval;
        match is_of_discs(&simulator.training) {
            true => Self { material: Material::Discs, interval, device: simulator.gpu.clone() },
            false => Self { material: Material::Law, interval, device: None },
        }
    }

    /// Its name in a sentence.
    pub fn name(&self) -> &'static str {
        match self.material {
            Material::Law => "the continuum law",
            Material::Discs => "discs of 10 to 20 mm",
        }
    }

    /// So many frames in a domain of a size (m); `body` are columns and the like. The law takes one thread, as a
    /// small scene gains nothing from more.
    ///
    /// # Errors
    /// If the scene cannot be computed.
    pub fn run(
        &self,
        name: &str,
        size: [f64; 2],
        body: &str,
        frames: usize,
    ) -> Result<Direct, StudyError> {
        let error = |reason: String| StudyError::Scene { name: name.into(), reason };
        let (material, threads) = match self.material {
            Material::Law => ("step = 4.0e-4\n[material]\nkind = \"mu-i\"\n", 1),
            Material::Discs => (
                "[material]\nkind = \"discs\"\n[grains]\nradius_min = 5.0e-3\nradius_max = 10.0e-3\n",
                0, // as many as there are cores
            ),
        };
        let text = format!(
            "duration = 10.0\nframe_interval = 0.02\n{material}[domain]\nsize = {size:?}\n\
             cell = 0.125\n{body}"
        );
        let mut scene = scene_messages::parse(name, &text)?;
        // The longest step that fits into the model's frames.
        scene.step = self.interval / (self.interval / scene.step).ceil();
        scene.frame_interval = self.interval;
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|e| error(e.to_string()))?;
        pool.install(|| self.simulate(scene, frames)).map_err(|e| error(e.to_string()))
    }

    fn simulate(&self, scene: Scene, frames: usize) -> Result<Direct, SimulationError> {
        let steps = scene.steps_per_frame();
        let mut simulation = Simulation::prepare(scene.clone(), self.device.as_ref(), None)?;
        if let Some(device) = &self.device {
            simulation.move_to(device, None)?;
        }
        let (header, points) = (simulation.header(utc_now()), simulation.static_points());
        let first = simulation.frame();
        let (mut positions, mut velocities) = (Frames::new(), Frames::new());
        for frame in 0..frames {
            while simulation.step < frame * steps {
                simulation.advance()?;
            }
            let now = simulation.frame();
            positions.push(now.position);
            velocities.push(now.velocity);
        }
        Ok(Direct { scene, positions, velocities, header, points, first })
    }

    /// Several runs: of the law in parallel, of discs, which share columns in the cache, one by one on all cores.
    ///
    /// # Errors
    /// The first one.
    pub fn runs<T: Sync>(
        &self,
        of: &[T],
        run: impl Fn(&T) -> Result<Direct, StudyError> + Sync,
    ) -> Result<Vec<Direct>, StudyError> {
        match self.material {
            Material::Law => of.par_iter().map(&run).collect(),
            Material::Discs => of.iter().map(&run).collect(),
        }
    }
}

/// A model to be tested, on a device.
///
/// # Errors
/// If the file cannot be read or the device cannot be used.
pub fn load(path: &Path, device: Device) -> Result<Simulator, StudyError> {
    let error = |reason| StudyError::Scene { name: path.display().to_string(), reason };
    let mut simulator = Simulator::load(path).map_err(|e| error(e.to_string()))?;
    simulator.select_device(device).map_err(|e| error(e.to_string()))?;
    Ok(simulator)
}

/// A column at a corner (m), of a size (m) and a velocity (m/s).
pub fn column(corner: [f64; 2], size: [f64; 2], velocity: [f64; 2]) -> String {
    format!("[[column]]\ncorner = {corner:?}\nsize = {size:?}\nvelocity = {velocity:?}\n")
}

/// A run of the teacher at the frame interval of a model.
pub struct Direct {
    scene: Scene,
    pub positions: Frames,
    velocities: Frames,
    header: Header,
    points: Points,
    /// With the fields that a network may see.
    first: Frame,
}

impl Direct {
    /// Its first frames, which a model starts from.
    pub fn start(&self, simulator: &Simulator) -> Result<InitialFrames, StudyError> {
        let name = &self.scene.name;
        let statics =
            static_features_of(simulator, name, &self.scene, || Ok(self.first.clone()))
                .map_err(|e| StudyError::Scene { name: name.clone(), reason: e.to_string() })?;
        let given = simulator.first_frames().min(self.positions.len());
        Ok(InitialFrames {
            scene: self.scene.clone(),
            header: self.header.clone(),
            points: self.points.clone(),
            positions: self.positions[..given].to_vec(),
            velocities: self.velocities[..given].to_vec(),
            time: 0.0,
            statics,
            frames: self.positions.len(),
            simulated_in: 0.0,
        })
    }
}

/// A prediction with its messages, except those about mirror images, which take two more predictions.
pub struct Rolled {
    /// Frames from the first of the start on.
    pub positions: Frames,
    pub said: Vec<String>,
    pub error: Option<String>,
}

/// Predicts up to so many frames, those of the start included.
pub fn roll(simulator: &Simulator, start: &InitialFrames, frames: usize) -> Rolled {
    let mut rollout = Rollout::new(simulator, start);
    let mut monitor = Monitor::new(start, simulator.training.frame_interval, frames);
    let said = start_checks(simulator, start).into_iter().collect();
    let mut rolled = Rolled { positions: start.positions.clone(), said, error: None };
    while rolled.positions.len() < frames {
        match rollout.advance() {
            Ok(next) => rolled.positions.push(next.to_vec()),
            Err(error) => {
                rolled.error = Some(error.to_string());
                break;
            }
        }
        rolled.said.extend(monitor.observe(rollout.frame(), rollout.before(), rollout.last()));
    }
    rolled
}

impl Rolled {
    /// All messages; `None` if there are none.
    pub fn said(&self) -> Option<String> {
        let all: Vec<&str> = self.said.iter().chain(&self.error).map(String::as_str).collect();
        (!all.is_empty()).then(|| all.join("; "))
    }

    /// Error at a frame over the motion until then.
    pub fn relative_error(&self, truth: &Frames, frame: usize) -> f64 {
        let motion = difference(&truth[frame], &truth[0]);
        difference(&self.positions[frame], &truth[frame]) / motion
    }

    /// The error at the end, relative to the motion, and the outcome.
    pub fn judge(&self, truth: &Frames) -> (f64, Outcome) {
        if self.error.is_some() {
            return (f64::NAN, Outcome::of(Some("breaks down".into()), self.said()));
        }
        let error = self.relative_error(truth, self.positions.len() - 1);
        let symptom = format!("wrong by {:.0} % of the motion", 100.0 * error);
        (error, Outcome::of((error > WRONG).then_some(symptom), self.said()))
    }

    /// The last predicted frame over that of the teacher.
    pub fn picture(&self, title: String, truth: &Frames, direct: &Direct) -> Picture {
        let last = self.positions.len() - 1;
        let time = last as f64 * direct.scene.frame_interval;
        let boxes = direct.scene.plate.iter().map(|plate| plate.at(time));
        let away = |(x, t): (&[f64; 2], &[f64; 2])| (x[0] - t[0]).hypot(x[1] - t[1]);
        Picture {
            title,
            colour: "distance from the teacher, m".into(),
            value: self.positions[last].iter().zip(&truth[last]).map(away).collect(),
            position: self.positions[last].clone(),
            radius: vec![0.5 * direct.scene.domain.spacing()],
            window: window(direct.scene.domain.size, [&self.positions[last], &truth[last]]),
            boxes: boxes.map(|b| [b.corner[0], b.corner[1], b.end()[0], b.end()[1]]).collect(),
            reference: truth[last].clone(),
        }
    }
}

/// The part of the domain that holds the points, from its lower left corner.
pub fn window(domain: [f64; 2], sets: [&[[f64; 2]]; 2]) -> [f64; 4] {
    let margin = 0.25;
    let end = |k: usize| {
        let largest = sets.iter().flat_map(|set| set.iter()).map(|x| x[k]).fold(0.0, f64::max);
        (largest + margin).min(domain[k])
    };
    [0.0, 0.0, end(0), end(1)]
}

/// Root mean square distance of points, m.
pub fn difference(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    mean_square_distance(a, b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_parts_of_the_motion() {
        let truth = vec![vec![[0.0, 0.0], [1.0, 0.0]], vec![[3.0, 4.0], [4.0, 4.0]]];
        let mut rolled = Rolled { positions: truth.clone(), said: vec![], error: None };
        assert_eq!(rolled.judge(&truth), (0.0, Outcome::Stable));
        // Nothing moved: wrong by all of the motion, and nothing was said.
        rolled.positions[1] = truth[0].clone();
        let (error, outcome) = rolled.judge(&truth);
        assert!((error - 1.0).abs() < 1e-12 && matches!(outcome, Outcome::Silent { .. }));
        rolled.said.push("doubt".into());
        assert!(matches!(rolled.judge(&truth).1, Outcome::Failed { .. }));
        rolled.error = Some("not finite".into());
        assert!(rolled.judge(&truth).1.text().contains("not finite"));
    }
}
