//! What datasets mean: `units` and `description`, for who opens a file without this program.

use super::layout::Field;

/// Attributes of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Meaning {
    /// The unit; `1` for a pure number.
    pub units: &'static str,
    /// The quantity in a few words.
    pub description: &'static str,
}

const fn meaning(units: &'static str, description: &'static str) -> Meaning {
    Meaning { units, description }
}

pub(super) const TIME: Meaning = meaning("s", "time of each frame");
pub(super) const MASS: Meaning = meaning("kg/m", "mass of each material point");
pub(super) const COLUMN: Meaning = meaning("1", "index of the column of each material point");
pub(super) const WALLS: Meaning = meaning("m", "fixed walls: segments x1, y1, x2, y2");
pub(super) const BOXES: Meaning =
    meaning("m", "obstacles and plates: x min, y min, x max, y max; NaN while absent");
pub(super) const GRAIN_RADIUS: Meaning = meaning("m", "radius of each grain");
pub(super) const GRAIN_COLUMN: Meaning = meaning("1", "index of the column of each grain");
pub(super) const GRAIN_POINT: Meaning =
    meaning("1", "index of the material point in whose square each grain starts");
pub(super) const GRAIN_POSITION: Meaning = meaning("m", "position of each grain: x, y");
pub(super) const GRAIN_VELOCITY: Meaning = meaning("m/s", "velocity of each grain: x, y");
pub(super) const GRAIN_PRESSURE: Meaning =
    meaning("Pa", "mean stress in each grain from its contacts, positive in compression");
pub(super) const GRID_X: Meaning = meaning("m", "x of the nodes of a row");
pub(super) const GRID_Y: Meaning = meaning("m", "y of the rows of nodes");
pub(super) const GRID_DENSITY: Meaning = meaning("kg/m3", "bulk density at the nodes");
pub(super) const GRID_VELOCITY: Meaning = meaning("m/s", "velocity at the nodes: x, y");
pub(super) const GRID_STRESS: Meaning =
    meaning("Pa", "Cauchy stress at the nodes: xx, xy, yx, yy, positive in tension");

/// Of a field of the material points.
pub(super) const fn of_field(field: Field) -> Meaning {
    match field {
        Field::Position => meaning("m", "position of each material point: x, y"),
        Field::Velocity => meaning("m/s", "velocity of each material point: x, y"),
        Field::Stress => meaning(
            "Pa",
            "Cauchy stress of each material point: xx, xy, yx, yy, positive in tension",
        ),
        Field::SolidFraction => meaning("1", "area of the grains over area of the packing"),
        Field::Coordination => meaning("1", "mean number of contacts per grain"),
        Field::InertialNumber => {
            meaning("1", "shear rate times grain diameter times sqrt(grain density / pressure)")
        }
    }
}

/// Of a scalar of the whole scene.
pub(super) fn of_budget(name: &str) -> Meaning {
    match name {
        "front" => meaning("m", "largest x of a point"),
        "front_99" => meaning("m", "least x of a point with 99 % of the mass at or behind it"),
        "front_connected" => meaning("m", "foremost x of a connected layer"),
        "max_height" => meaning("m", "largest y of a point"),
        "kinetic_energy" => meaning("J/m", "sum of m v^2 / 2"),
        "potential_energy" => meaning("J/m", "sum of -m g x, zero at the origin"),
        "momentum_x" => meaning("kg/s", "sum of m v along x"),
        "momentum_y" => meaning("kg/s", "sum of m v along y"),
        "plate_work" => meaning("J/m", "work done by the plate since the start"),
        "points_projected" => {
            meaning("1", "number of points moved back onto a wall or face since the start")
        }
        "stable_step" => meaning("s", "stability bound of this state"),
        "courant" => meaning("1", "time step over the least time to cross a cell"),
        "elastic_energy" => meaning("J/m", "energy in contacts"),
        "dashpot_loss" => meaning("J/m", "energy lost in dashpots of contacts since the start"),
        "friction_loss" => meaning("J/m", "energy lost in friction since the start"),
        "damping_loss" => {
            meaning("J/m", "energy lost in damping and by grains held at rest since the start")
        }
        "energy_drift" => meaning("J/m", "energy missing in the sum since the start"),
        "disc_steps" => meaning("1", "DEM steps of single discs that were computed"),
        "sleep_audit" => meaning("m", "largest displacement of a disc computed that would sleep"),
        "expected_error" => meaning(
            "m",
            "root mean square distance from the truth to expect of a prediction, median",
        ),
        "error_bound" => meaning("m", "the same, above it in one of ten scenes"),
        "stress_free_points" => meaning("1", "number of points too loose for stress"),
        _ => meaning("unknown", "scalar of the whole scene"),
    }
}
