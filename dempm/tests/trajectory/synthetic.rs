//! A trajectory that looks like a column collapse, made without any physics: a square column turns
//! smoothly into a triangular heap of the same area while a gate goes up.

use std::collections::BTreeMap;
use std::path::Path;

use dempm::trajectory::{Frame, Header, Points, TrajectoryWriter};

/// Width and height of the column, m.
const SIDE: f64 = 3.0;
/// Length of the final heap, m.
const RUNOUT: f64 = 7.5;
/// Frames of the whole collapse, one every 0.01 s.
const FRAMES: usize = 301;

/// A collapse of `rows * rows` points.
pub struct Collapse {
    rows: usize,
}

impl Collapse {
    pub fn new(rows: usize) -> Self {
        Self { rows }
    }

    pub fn header(&self) -> Header {
        Header {
            title: "Synthetic column collapse".to_owned(),
            scene: "title = \"Synthetic column collapse\"\n# µ, σ: not only ASCII\n".to_owned(),
            seed: 42,
            created: files::utc_now(),
            versions: BTreeMap::from([("dempm".to_owned(), "0.1.0".to_owned())]),
            device: "cpu, 2 threads".to_owned(),
            precision: "f64".to_owned(),
            material: "synthetic".to_owned(),
            domain: [10.0, 4.0],
            gravity: [0.0, -9.81],
            grid_cell: 2.0 * self.spacing(),
            point_spacing: self.spacing(),
            time_step: 1e-4,
            frame_interval: 0.01,
            parameters: BTreeMap::from([("thickness".to_owned(), 0.0075)]),
            walls: vec![[0.0, 0.0, 10.0, 0.0], [0.0, 0.0, 0.0, 4.0], [10.0, 0.0, 10.0, 4.0]],
        }
    }

    pub fn points(&self) -> Points {
        let count = self.rows * self.rows;
        Points {
            mass: vec![2000.0 * self.spacing().powi(2); count],
            column: (0..count).map(|point| (point % self.rows * 2 / self.rows) as u32).collect(),
        }
    }

    /// Frame `index` of [`FRAMES`].
    pub fn frame(&self, index: usize) -> Frame {
        let time = index as f64 * 0.01;
        let (position, before) = (self.positions(time), self.positions(time - 0.01));
        let velocity: Vec<[f64; 2]> = std::iter::zip(&position, &before)
            .map(|(now, then)| [(now[0] - then[0]) / 0.01, (now[1] - then[1]) / 0.01])
            .collect();
        let (_, height) = heap(progress(time));
        let mut stress = Vec::new();
        let mut solid_fraction = Vec::new();
        let mut inertial_number = Vec::new();
        for (x, v) in std::iter::zip(&position, &velocity) {
            let pressure = 2000.0 * 9.81 * (height(x[0]) - x[1]).max(0.0);
            let speed = v[0].hypot(v[1]);
            let shear = -0.25 * pressure * speed / (1.0 + speed);
            stress.push([-0.5 * pressure, shear, shear, -pressure].map(|s| s as f32));
            solid_fraction.push((0.84 - 0.02 * speed) as f32);
            inertial_number.push((1e-4 + 0.02 * speed / (1.0 + pressure / 1e4)) as f32);
        }
        let kinetic: f64 = velocity.iter().map(|v| 0.5 * (v[0] * v[0] + v[1] * v[1])).sum();
        let gate = 0.5 * time;
        Frame {
            time,
            coordination: Some(solid_fraction.iter().map(|phi| 4.0 * phi).collect()),
            solid_fraction: Some(solid_fraction),
            inertial_number: Some(inertial_number),
            stress: Some(stress),
            boxes: vec![
                [8.0, 0.0, 8.4, 0.6],
                if gate > 0.5 { [f64::NAN; 4] } else { [3.02, 6.0 * gate, 3.12, 3.5 + gate] },
            ],
            budget: BTreeMap::from([
                ("front".to_owned(), position.iter().map(|x| x[0]).fold(0.0, f64::max)),
                ("max_height".to_owned(), position.iter().map(|x| x[1]).fold(0.0, f64::max)),
                ("kinetic_energy".to_owned(), kinetic * 2000.0 * self.spacing().powi(2)),
            ]),
            position,
            velocity,
            grains: None,
            grid: None,
        }
    }

    /// Writes `frames` frames, evenly over the collapse.
    pub fn write(&self, path: &Path, frames: usize) {
        self.write_with(path, &self.header(), frames);
    }

    /// As [`write`](Self::write), with another header.
    pub fn write_with(&self, path: &Path, header: &Header, frames: usize) {
        let mut writer = TrajectoryWriter::create(path, header, &self.points()).unwrap();
        for index in 0..frames {
            writer.push(self.frame(index * (FRAMES - 1) / (frames - 1).max(1))).unwrap();
        }
        writer.set_wall_time("rve", 12.5);
        writer.set_wall_time("mpm", 0.75);
        writer.finish("finished").unwrap();
    }

    fn spacing(&self) -> f64 {
        SIDE / self.rows as f64
    }

    fn positions(&self, time: f64) -> Vec<[f64; 2]> {
        let progress = progress(time);
        let (place, height) = heap(progress);
        let mut positions = Vec::new();
        for row in 0..self.rows {
            for column in 0..self.rows {
                let [u, v] = [column, row].map(|i| (i as f64 + 0.5) / self.rows as f64);
                let x = place(u);
                positions.push([x, v * height(x)]);
            }
        }
        positions
    }
}

/// From the column (0) to the heap (1).
fn progress(time: f64) -> f64 {
    let s = (time / 2.5).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// Where the fraction of the material left of x ends up, and the height of the surface there: a
/// trapezium of area SIDE^2 that narrows from a square to a triangle.
fn heap(progress: f64) -> (impl Fn(f64) -> f64, impl Fn(f64) -> f64) {
    let length = SIDE + progress * (RUNOUT - SIDE);
    let mean = SIDE * SIDE / length;
    // Height falls from mean * (1 + progress) at the wall to mean * (1 - progress) at the front.
    let height = move |x: f64| mean * (1.0 + progress * (1.0 - 2.0 * (x / length).min(1.0)));
    let place = move |u: f64| {
        if progress < 1e-9 {
            return u * length;
        }
        // u = z (1 + p) - p z^2 with z = x / length
        let b = 1.0 + progress;
        length * (b - (b * b - 4.0 * progress * u).sqrt()) / (2.0 * progress)
    };
    (place, height)
}
