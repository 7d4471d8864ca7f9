//! The explicit MPM step.

use rayon::prelude::*;

use crate::bins::Bins;
use crate::boundary::Boundary;
use crate::budget::{self, Budget, Ledger};
use crate::cell_average::CellAverage;
use crate::confine::confine;
use crate::density::{correct_density, node_areas};
use crate::g2p;
use crate::grid::{Domain, Node, Shape};
use crate::grid_update;
use crate::obstacle::{Obstacle, Placed};
use crate::p2g::{self, Mapping};
use crate::stable_step::{self, StableStep};
use crate::stencil::{self, Stencil, with_width};
use crate::velocity_gradient::velocity_gradient;
use crate::{Error, Material, Numerics, PARALLEL_GRAIN, Points, Scheme, Vec2, WallContact};

/// Background grid, walls, obstacles and time. Points and material belong to the caller.
pub struct Solver {
    domain: Domain,
    numerics: Numerics,
    gravity: Vec2,
    pub(crate) obstacles: Vec<Obstacle>,
    time: f64,
    ledger: Ledger,

    pub(crate) shape: Shape,
    nodes: Vec<Node>,
    stencils: Vec<Stencil>,
    bins: Bins,
    /// Nodes up to this mass (kg/m) are left at rest.
    cutoff: f64,
    placed: Vec<Placed>,
    patches: Vec<f64>,
    row_impulse: Vec<Vec2>,
    impulse: Vec<Vec2>,
    cell_average: CellAverage,
    /// Where densities are corrected (m²).
    pub(crate) node_areas: Vec<f64>,
}

impl Solver {
    /// A solver at time 0 with `gravity` (m/s²).
    ///
    /// # Errors
    /// Domain, scheme, gravity or an obstacle is impossible.
    pub fn new(
        domain: Domain,
        numerics: Numerics,
        gravity: Vec2,
        obstacles: Vec<Obstacle>,
    ) -> Result<Self, Error> {
        let shape = Shape::new(&domain)?;
        domain.walls.check_domain()?;
        numerics.check()?;
        if !gravity.iter().all(|g| g.is_finite()) {
            return Err(Error::Gravity(gravity));
        }
        obstacles.iter().enumerate().try_for_each(|(k, obstacle)| obstacle.check(k))?;
        let corrected = numerics.density_correction > 0.0;
        let node_areas = if corrected { node_areas(numerics.basis, &shape) } else { Vec::new() };
        Ok(Self {
            ledger: Ledger::new(obstacles.len()),
            nodes: vec![Node::default(); shape.columns * shape.rows],
            impulse: vec![Vec2::zeros(); 1 + obstacles.len()],
            domain,
            numerics,
            gravity,
            obstacles,
            time: 0.0,
            shape,
            stencils: Vec::new(),
            bins: Bins::default(),
            cutoff: 0.0,
            placed: Vec::new(),
            patches: Vec::new(),
            row_impulse: Vec::new(),
            cell_average: CellAverage::default(),
            node_areas,
        })
    }

    /// Advances all points by one step of `dt` (s).
    ///
    /// # Errors
    /// The step or a point is impossible, or the material failed.
    pub fn advance(
        &mut self,
        points: &mut Points,
        material: &mut dyn Material,
        dt: f64,
    ) -> Result<(), Error> {
        if !(dt.is_finite() && dt > 0.0) {
            return Err(Error::Step(dt));
        }
        // Enter the thread pool once, not at every parallel loop.
        rayon::scope(|_| self.step(points, material, dt))
    }

    fn step(
        &mut self,
        points: &mut Points,
        material: &mut dyn Material,
        dt: f64,
    ) -> Result<(), Error> {
        let mass = points.check(&self.shape)?;
        self.cutoff = self.numerics.cutoff(mass, points.len());
        self.place_obstacles(self.time, dt);

        self.evaluate_basis(points);
        self.map_mass_and_momentum(points);
        if self.numerics.wall_contact == WallContact::Points {
            self.set_approach(points, dt);
        }
        if self.numerics.scheme == Scheme::Usf {
            self.old_velocity();
            self.update_stress(points, material, dt)?;
        }
        self.map_internal_force(points);
        self.update_grid(dt);
        self.apply_boundary_conditions();
        self.transfer_to_points(points, dt);
        self.confine(points, dt)?;
        if self.numerics.scheme == Scheme::Musl {
            self.map_velocity_again(points);
        }
        if self.numerics.scheme != Scheme::Usf {
            self.update_stress(points, material, dt)?;
        }
        self.time += dt;
        Ok(())
    }

    fn place_obstacles(&mut self, t: f64, dt: f64) {
        self.placed.clear();
        self.placed.extend(self.obstacles.iter().map(|o| Placed::new(o, &self.shape, t, dt)));
    }

    /// Basis functions at the points, and points sorted by the nodes they see.
    fn evaluate_basis(&mut self, points: &Points) {
        let Shape { columns, rows, .. } = self.shape;
        stencil::evaluate(self.numerics.basis, &self.shape, &points.position, &mut self.stencils);
        self.bins.sort(&self.stencils, columns, rows, self.numerics.basis.width());
    }

    fn map_mass_and_momentum(&mut self, points: &Points) {
        let affine = self.numerics.transfer.affine();
        let basis = self.numerics.basis;
        let (mut map, nodes) = self.mapping();
        with_width!(basis, W => p2g::mass_and_momentum::<W>(&mut map, points, affine, nodes));
    }

    fn set_approach(&mut self, points: &Points, dt: f64) {
        let width = self.numerics.basis.width();
        let boundary =
            Boundary { shape: &self.shape, walls: &self.domain.walls, obstacles: &self.placed };
        boundary.set_approach(&mut self.nodes, &self.bins, width, points, dt);
    }

    fn map_internal_force(&mut self, points: &Points) {
        let basis = self.numerics.basis;
        let shock_width = self.numerics.shock_width * self.shape.cell;
        let (mut map, nodes) = self.mapping();
        with_width!(basis, W => p2g::internal_force::<W>(&mut map, points, shock_width, nodes));
    }

    fn update_grid(&mut self, dt: f64) {
        let (columns, spans) = (self.shape.columns, self.bins.spans());
        grid_update::accelerate(&mut self.nodes, columns, spans, self.cutoff, self.gravity, dt);
    }

    fn apply_boundary_conditions(&mut self) {
        self.constrain();
        self.ledger.wall_impulse += self.impulse[0];
        for (k, impulse) in self.impulse[1..].iter().enumerate() {
            self.ledger.book_obstacle(k, *impulse, self.placed[k].velocity);
        }
    }

    fn transfer_to_points(&mut self, points: &mut Points, dt: f64) {
        let (transfer, columns) = (self.numerics.transfer, self.shape.columns);
        with_width!(self.numerics.basis, W =>
            g2p::transfer::<W>(transfer, &self.nodes, columns, &self.stencils, points, dt));
    }

    /// Against walls, and obstacles where they stand after the step.
    fn confine(&mut self, points: &mut Points, dt: f64) -> Result<(), Error> {
        self.place_obstacles(self.time + dt, dt);
        confine(points, &self.shape, &self.placed, &mut self.ledger)
    }

    /// Grid velocity of the new point velocities, still at the old positions.
    fn map_velocity_again(&mut self, points: &Points) {
        let affine = self.numerics.transfer.affine();
        let basis = self.numerics.basis;
        let (mut map, nodes) = self.mapping();
        with_width!(basis, W => p2g::momentum::<W>(&mut map, points, affine, nodes));
        self.old_velocity();
    }

    /// `v_i` from the mapped momentum, with boundary conditions.
    fn old_velocity(&mut self) {
        let (columns, spans) = (self.shape.columns, self.bins.spans());
        grid_update::velocity(&mut self.nodes, columns, spans, self.cutoff);
        self.constrain();
    }

    fn update_stress(
        &mut self,
        points: &mut Points,
        material: &mut dyn Material,
        dt: f64,
    ) -> Result<(), Error> {
        let columns = self.shape.columns;
        let gradient = &mut points.velocity_gradient;
        with_width!(self.numerics.basis, W =>
            velocity_gradient::<W>(&self.nodes, columns, &self.stencils, gradient));
        if self.numerics.cell_average_volumetric {
            self.cell_average.apply(&self.shape, &points.position, &points.volume, gradient);
        }
        let rate = self.numerics.density_correction;
        if rate > 0.0 {
            let material = (&points.mass[..], &points.volume[..]);
            with_width!(self.numerics.basis, W => correct_density::<W>(
                rate, &self.nodes, &self.node_areas, columns, &self.stencils, material, gradient));
        }
        material.update(dt, gradient, &mut points.stress, &mut points.volume)?;
        check_response(points)
    }

    /// Boundary conditions on the grid velocity; impulses into `self.impulse`.
    fn constrain(&mut self) {
        let boundary =
            Boundary { shape: &self.shape, walls: &self.domain.walls, obstacles: &self.placed };
        boundary.apply(
            &mut self.nodes,
            self.bins.spans(),
            &mut self.row_impulse,
            &mut self.impulse,
        );
    }

    fn mapping(&mut self) -> (Mapping<'_>, &mut [Node]) {
        let map = Mapping {
            bins: &self.bins,
            stencils: &self.stencils,
            cell: self.shape.cell,
            columns: self.shape.columns,
            patches: &mut self.patches,
        };
        (map, &mut self.nodes)
    }

    /// Time (s).
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Sets the time (s), and with it the place of moving obstacles, for a restart.
    pub fn set_time(&mut self, time: f64) {
        self.time = time;
    }

    /// Impulses and work of contacts since the start.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Sets impulses and work of contacts, for a restart.
    ///
    /// # Errors
    /// The number of obstacles differs.
    pub fn set_ledger(&mut self, ledger: Ledger) -> Result<(), Error> {
        let (expected, found) = (self.obstacles.len(), ledger.obstacle_impulse.len());
        if found != expected {
            return Err(Error::Length { field: "obstacle_impulse", expected, found });
        }
        self.ledger = ledger;
        Ok(())
    }

    /// The domain.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// The numerical scheme.
    pub fn numerics(&self) -> &Numerics {
        &self.numerics
    }

    /// Gravity (m/s²).
    pub fn gravity(&self) -> Vec2 {
        self.gravity
    }

    /// Obstacles where they stand at a time (s).
    pub fn obstacles_at(&self, time: f64) -> impl ExactSizeIterator<Item = Obstacle> + '_ {
        self.obstacles.iter().map(move |o| o.at(time))
    }

    /// Bounds on the step in the present state.
    ///
    /// # Errors
    /// A point is impossible.
    pub fn stable_step(
        &self,
        points: &Points,
        material: &dyn Material,
    ) -> Result<StableStep, Error> {
        stable_step::stable_step(&self.shape, &self.numerics, points, material)
    }

    /// Mass, momentum and energy of the points, and impulses and work of contacts.
    pub fn budget(&self, points: &Points) -> Budget {
        budget::budget(points, self.gravity, &self.ledger)
    }
}

/// The first point whose stress is not finite or whose volume is not positive is an error.
fn check_response(points: &Points) -> Result<(), Error> {
    let wrong =
        points.stress.par_iter().zip(&points.volume).with_min_len(PARALLEL_GRAIN).position_first(
            |(stress, &volume)| {
                !(stress.iter().all(|s| s.is_finite()) && volume.is_finite() && volume > 0.0)
            },
        );
    match wrong {
        Some(point) => Err(Error::Response {
            point,
            stress: points.stress[point],
            volume: points.volume[point],
        }),
        None => Ok(()),
    }
}
