//! The material of a scene as an input of networks.

use dem::assembly::Floor;
use dempm::scene::{Material, Scene};

use super::obstacle::friction_coefficient;

/// Numbers that describe a material.
pub const MATERIAL_COLUMNS: usize = 4;

/// What a network may know of the material: friction coefficient of the grains; log2 of their mean
/// diameter over the distance of points; friction coefficient of the floor; 1 if the floor is a row of
/// grains. A law instead of grains has its static friction and grain diameter, elasticity neither.
pub fn material(scene: &Scene) -> [f32; MATERIAL_COLUMNS] {
    let (friction, diameter) = match (&scene.material, scene.material.grains()) {
        (_, Some(grains)) => (grains.friction, grains.radius_min + grains.radius_max),
        (Material::MuI(law), None) => (law.static_friction, law.grain_diameter),
        (_, None) => (0.0, scene.domain.spacing()),
    };
    let size = (diameter / scene.domain.spacing()).log2();
    let rough = matches!(&scene.material, Material::Discs(discs) if discs.floor == Floor::Rough);
    let floor = friction_coefficient(scene.domain.walls.bottom);
    [friction as f32, size as f32, floor, f32::from(u8::from(rough))]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(more: &str) -> [f32; 4] {
        let text = format!(
            "duration = 1.0\n[domain]\nsize = [3.96, 2.04]\ncell = 0.12\n\
             walls = {{ bottom = 0.4 }}\n[[column]]\nsize = [0.6, 0.6]\n{more}"
        );
        material(&Scene::parse(&text, "scene.toml").unwrap())
    }

    #[test]
    fn grains_and_floor_of_each_kind_of_material() {
        // Points are half a cell apart: 0.06 m, eight diameters of 7.5 mm.
        let grains = "[grains]\nradius_min = 2.5e-3\nradius_max = 5e-3\nfriction = 0.3\n";
        let discs = format!("[material]\nkind = \"discs\"\n{grains}");
        assert_eq!(seen(&discs), [0.3, -3.0, 0.4, 1.0]);
        assert_eq!(seen(&format!("{discs}[discs]\nfloor = \"flat\"\n")), [0.3, -3.0, 0.4, 0.0]);
        assert_eq!(seen(&format!("[material]\nkind = \"rve\"\n{grains}")), [0.3, -3.0, 0.4, 0.0]);
        assert_eq!(seen("[material]\nkind = \"mu-i\"\n"), [0.288, -3.0, 0.4, 0.0]);
    }
}
