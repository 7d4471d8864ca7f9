//! The schema: every key of a scene file with its default and limits.

use dem::assembly::Floor;
use dem::cuda::Room;
use mpm::{Basis, Friction, Numerics, Scheme, Transfer, WallContact, Walls};
use toml::de::DeTable;

use super::defaults;
use super::log::Log;
use super::model::{
    Chosen, Column, Discs, Domain, GridOutput, InitialStress, Material, Obstacle, Plate,
    PointLayout, Precision, Rectangle, Rve, Scene,
};
use super::parameters;
use super::problem::Problem;
use super::range::{
    GRAVITY, LENGTH, Limits, MAX_POINTS_PER_CELL, TIME, between, from_zero, positive, within,
};
use super::reader::Table;
use crate::trajectory::Field;

const POSITION: Limits = within(LENGTH, "m").with_example(0.0);
const SIZE: Limits = positive(LENGTH, "m").with_example(1.0);
const SPEED: Limits = within(1.0e3, "m/s");
const COULOMB: Limits =
    from_zero(10.0, "").with_example(0.5).with_hint("a Coulomb friction coefficient, such as 0.5");

/// Parses the text. The first problem of the syntax is reported to the log: others mostly follow from it.
pub(super) fn parse<'a>(log: &Log, text: &'a str) -> DeTable<'a> {
    let (document, errors) = DeTable::parse_recoverable(text);
    if let Some(error) = errors.first() {
        log.report(
            Problem::error("this is not valid TOML")
                .at(error.span(), error.message())
                .help("a line is a [table], a [[list of tables]], or `key = value`"),
        );
    }
    document.into_inner()
}

/// Reads a document. The scene is only meaningful if the log has no problem afterwards.
pub(super) fn read(log: &Log, document: &DeTable<'_>, name: &str, text: &str) -> Scene {
    let root = Table::root(log, document);
    let (material, initial_stress) = material(log, &root);
    let (fields, grains_every, grid) = output(&root, &material);
    let numerics = numerics(&root, &material);
    let domain = domain(&root, &material);
    let frame_interval = root.number("frame_interval", Some(0.01), positive(TIME, "s"));
    let scene = Scene {
        name: name.to_owned(),
        text: text.to_owned(),
        title: root.text("title", stem(name)),
        seed: root.integer("seed", 1, between(0.0, u32::MAX as f64, "")),
        gravity: root.vector("gravity", Some([0.0, -9.81]), within(GRAVITY, "m/s²")),
        duration: root.number("duration", None, positive(TIME, "s").with_example(3.0)),
        step: root.number(
            "step",
            Some(defaults::step(&material, domain.cell, frame_interval)),
            positive(1.0, "s").with_hint("seconds: 0.1 ms is 1.0e-4"),
        ),
        frame_interval,
        stop_at_rest: root.boolean("stop_at_rest", true),
        domain,
        columns: columns(&root),
        obstacles: root.tables("obstacle", |table| {
            let obstacle = Obstacle {
                place: rectangle(&table, None),
                faces: faces(&table, "faces", BOX_FACES),
            };
            table.finish();
            obstacle
        }),
        plate: plate(&root),
        material,
        initial_stress,
        numerics,
        fields,
        grains_every,
        grid,
        choice: choice(&root),
        warnings: Vec::new(),
    };
    root.finish();
    scene
}

/// The file name without folder and ending.
fn stem(name: &str) -> &str {
    let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
    file.strip_suffix(".toml").unwrap_or(file)
}

fn domain(root: &Table<'_>, material: &Material) -> Domain {
    if !root.has("domain") {
        root.missing("[domain]", "[domain] and below it size = [10.0, 10.0]");
    }
    let table = root.table("domain");
    let layouts = [("staggered", PointLayout::Staggered), ("square", PointLayout::Square)];
    let layout = table.choice("point_layout", Some(PointLayout::Staggered), &layouts);
    let domain = Domain {
        size: table.vector("size", None, SIZE),
        cell: table.number("cell", Some(defaults::cell(material)), positive(LENGTH, "m")),
        points_per_cell: table.integer(
            "points_per_cell",
            2,
            between(1.0, MAX_POINTS_PER_CELL as f64, "points"),
        ) as usize,
        point_layout: match material {
            // Their points are means over squares.
            Material::Discs(_) => PointLayout::Square,
            Material::Rve(_) | Material::MuI(_) | Material::Elastic(_) => layout,
        },
        walls: faces(&table, "walls", WALLS),
    };
    table.finish();
    domain
}

/// The statement of a choice, which `dempm run --within` writes.
fn choice(root: &Table<'_>) -> Option<Chosen> {
    let table = root.table("choice");
    let optional =
        |key: &str| table.has(key).then(|| table.number(key, None, positive(LENGTH, "m")));
    let (expected, bound) = (optional("expected"), optional("bound"));
    let given = table.is_given();
    let default = (!given).then_some(0.1);
    let model = table.text("model", "");
    let within = table.number("within", default, positive(LENGTH, "m"));
    table.finish();
    given.then_some(Chosen { model, within, expected, bound })
}

fn columns(root: &Table<'_>) -> Vec<Column> {
    if !root.has("column") {
        root.missing("[[column]]", "[[column]] and below it size = [3.0, 3.0]");
    }
    root.tables("column", |table| {
        let column = Column {
            place: rectangle(&table, Some([0.0, 0.0])),
            velocity: table.vector("velocity", Some([0.0, 0.0]), SPEED),
        };
        table.finish();
        column
    })
}

fn plate(root: &Table<'_>) -> Option<Plate> {
    let table = root.table("plate");
    let plate = Plate {
        place: rectangle(&table, None),
        velocity: table.vector("velocity", None, SPEED.with_example(-0.1)),
        start: table.number("start", Some(0.0), from_zero(TIME, "s")),
        faces: faces(&table, "faces", BOX_FACES),
    };
    let given = table.is_given();
    table.finish();
    given.then_some(plate)
}

fn rectangle(table: &Table<'_>, corner: Option<[f64; 2]>) -> Rectangle {
    Rectangle {
        corner: table.vector("corner", corner, POSITION),
        size: table.vector("size", None, SIZE),
    }
}

/// The walls of the domain: a floor with friction in a smooth box.
const WALLS: Walls = Walls {
    left: Friction::Slip,
    right: Friction::Slip,
    bottom: Friction::Coulomb(0.5),
    top: Friction::Slip,
};
/// Obstacles and plates: the friction of the floor on top and bottom, smooth sides.
const BOX_FACES: Walls = Walls { top: Friction::Coulomb(0.5), ..WALLS };

fn faces(parent: &Table<'_>, key: &str, default: Walls) -> Walls {
    let table = parent.table(key);
    let words = [("slip", Friction::Slip), ("stick", Friction::Stick)];
    let face =
        |key, default| table.word_or_number(key, default, &words, Friction::Coulomb, COULOMB);
    let faces = Walls {
        left: face("left", default.left),
        right: face("right", default.right),
        bottom: face("bottom", default.bottom),
        top: face("top", default.top),
    };
    table.finish();
    faces
}

fn material(log: &Log, root: &Table<'_>) -> (Material, InitialStress) {
    /// The value of `kind`; the parameters have a table of their own.
    #[derive(Clone, Copy)]
    enum Kind {
        Discs,
        Rve,
        MuI,
        Elastic,
    }
    let table = root.table("material");
    let kinds = [
        ("rve", Kind::Rve),
        ("mu-i", Kind::MuI),
        ("elastic", Kind::Elastic),
        ("discs", Kind::Discs),
    ];
    let kind = table.choice("kind", Some(Kind::Rve), &kinds);
    let packings =
        table.integer("packings", defaults::PACKINGS, between(1.0, 1024.0, "packings")) as usize;
    let precisions = [("f32", Precision::F32), ("f64", Precision::F64)];
    let precision = table.choice("precision", Some(Precision::F32), &precisions);
    let rooms = [("usual", Room::Usual), ("ample", Room::Ample)];
    let neighbours = table.choice("neighbours", Some(Room::Usual), &rooms);
    let stresses = [("ladder", InitialStress::Ladder), ("none", InitialStress::None)];
    let initial_stress = table.choice("initial_stress", Some(InitialStress::Ladder), &stresses);
    table.finish();

    // All tables are read, so that one scene can hold several materials and choose by `kind`.
    let mut defaults = defaults::packings();
    if matches!(kind, Kind::Discs) {
        defaults.grains = defaults::discs();
    }
    let rve = parameters::read_rve(log, root, &defaults);
    let mu_i = parameters::read(log, root.table("mu-i"), &Default::default(), &[]);
    let elastic = parameters::read(log, root.table("elastic"), &Default::default(), &[]);
    let (floor, sleep) = discs(root);
    let material = match kind {
        Kind::Discs => Material::Discs(Discs { grains: rve.grains, floor, sleep, precision }),
        Kind::Rve => Material::Rve(Rve { parameters: rve, packings, precision, neighbours }),
        Kind::MuI => Material::MuI(mu_i),
        Kind::Elastic => Material::Elastic(elastic),
    };
    (material, initial_stress)
}

fn discs(root: &Table<'_>) -> (Floor, bool) {
    let table = root.table("discs");
    let floors = [("rough", Floor::Rough), ("flat", Floor::Flat)];
    let floor = table.choice("floor", Some(Floor::Rough), &floors);
    let sleep = table.boolean("sleep", true);
    table.finish();
    (floor, sleep)
}

fn numerics(root: &Table<'_>, material: &Material) -> Numerics {
    let table = root.table("numerics");
    let bases = [
        ("quadratic", Basis::Quadratic),
        ("gimp", Basis::Gimp),
        ("cubic", Basis::Cubic),
        ("linear", Basis::Linear),
    ];
    let schemes = [("musl", Scheme::Musl), ("usl", Scheme::Usl), ("usf", Scheme::Usf)];
    // Rates are the defaults of `relaxation`.
    let (flip_apic, wall_contact, correction, shock_width) = match material {
        Material::Rve(_) => (
            defaults::TRANSFER,
            defaults::WALL_CONTACT,
            defaults::DENSITY_CORRECTION,
            defaults::SHOCK_WIDTH,
        ),
        _ => (Transfer::default(), WallContact::Nodes, 0.0, 0.0),
    };
    let transfers = [
        ("flip-apic", flip_apic),
        ("flip", Transfer::Flip { rate: 1.0 }),
        ("apic", Transfer::Apic),
        ("pic", Transfer::Pic),
    ];
    let mut transfer = table.choice("transfer", Some(transfers[0].1), &transfers);
    let rate_limits = from_zero(1.0e9, "1/s");
    match &mut transfer {
        Transfer::FlipApic { rate } | Transfer::Flip { rate } => {
            *rate = table.number("relaxation", Some(*rate), rate_limits);
        }
        Transfer::Apic | Transfer::Pic => {
            table.number("relaxation", Some(0.0), rate_limits);
        }
    }
    let wall_contacts = [("nodes", WallContact::Nodes), ("points", WallContact::Points)];
    let numerics = Numerics {
        basis: table.choice("basis", Some(Basis::Quadratic), &bases),
        scheme: table.choice("scheme", Some(Scheme::Musl), &schemes),
        transfer,
        wall_contact: table.choice("wall_contact", Some(wall_contact), &wall_contacts),
        cell_average_volumetric: table.boolean("cell_average", false),
        density_correction: table.number("density_correction", Some(correction), rate_limits),
        shock_width: table.number("shock_width", Some(shock_width), from_zero(100.0, "cells")),
        ..Numerics::default()
    };
    table.finish();
    numerics
}

fn output(root: &Table<'_>, material: &Material) -> (Vec<Field>, usize, Option<GridOutput>) {
    let table = root.table("output");
    let options = Field::ALL.map(|field| (field.name(), field));
    let chosen = table.choices("fields", &Field::OPTIONAL, &options);
    let grains_every = table.integer("grains_every", 0, from_zero(1.0e6, "frames")) as usize;
    let grid = grid(table.table("grid"), material);
    table.finish();
    // Positions and velocities are in every trajectory; naming them is allowed and changes nothing.
    let fields = Field::OPTIONAL.into_iter().filter(|field| chosen.contains(field)).collect();
    (fields, grains_every, grid)
}

/// Mean diameters in the width of a grid by default.
const GRID_WIDTH: f64 = 3.0;

fn grid(table: Table<'_>, material: &Material) -> Option<GridOutput> {
    let diameter = material.grains().map_or(1.0, |grains| grains.mean_diameter());
    let width = table.number("width", Some(GRID_WIDTH * diameter), positive(LENGTH, "m"));
    let spacing = table.number("spacing", Some(width), positive(LENGTH, "m"));
    let given = table.is_given();
    table.finish();
    given.then_some(GridOutput { width, spacing })
}
