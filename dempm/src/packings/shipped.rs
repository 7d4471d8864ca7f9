//! Consolidated packings of scenes with default grains, which come with the program: to make them takes most of a first
//! run.

use std::collections::BTreeMap;
use std::io::Read;
use std::sync::LazyLock;

use dem::{ContactLaw, Grains, Packing};
use flate2::read::ZlibDecoder;

use super::key::Key;

/// Compressed packings by their keys, without what [`set_constants`] sets.
static FILE: &[u8] = include_bytes!("../../assets/packings.bin");

static PACKINGS: LazyLock<Packings> = LazyLock::new(|| unpacked(FILE).unwrap_or_default());

type Packings = BTreeMap<Key, Packing<f64>>;

/// Whether there is a packing with this key.
pub(super) fn has(key: &Key) -> bool {
    PACKINGS.contains_key(key)
}

/// The packing with this key and these grains, with the bits that it has when it is made.
pub(super) fn packing(key: &Key, grains: &Grains) -> Option<Packing<f64>> {
    let mut packing = PACKINGS.get(key)?.clone();
    set_constants(&mut packing, grains);
    Some(packing)
}

fn unpacked(file: &[u8]) -> Option<Packings> {
    let mut bytes = Vec::new();
    ZlibDecoder::new(file).read_to_end(&mut bytes).ok()?;
    postcard::from_bytes(&bytes).ok()
}

/// Sets what follows from radii and grains: masses of discs and dashpots of pairs.
fn set_constants(packing: &mut Packing<f64>, grains: &Grains) {
    let made = Packing::<f64>::new(packing.cell, &packing.plain_discs(), |r| grains.disc_mass(r));
    let Packing { discs, neighbours, .. } = packing;
    for (disc, made) in discs.iter_mut().zip(made.discs) {
        (disc.inv_mass, disc.inv_inertia) = (made.inv_mass, made.inv_inertia);
    }
    let law = ContactLaw::<f64>::new(grains, grains.step());
    for pair in &mut neighbours.pairs {
        pair.dashpot = law.dashpot(&discs[pair.i as usize], &discs[pair.j as usize]);
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use dem::{RveParameters, consolidate};
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use rayon::prelude::*;

    use super::super::consolidated_key;
    use super::*;
    use crate::scene::{Material, Scene};

    const COMMAND: &str =
        "cargo test --release -p dempm --lib make_the_packings_that_ship -- --ignored";

    /// Parameters and seeds of a scene that says no more than it must.
    fn default_scene() -> (RveParameters, Vec<u64>) {
        let text = "duration = 1.0\n[domain]\nsize = [2.0, 1.0]\n[[column]]\nsize = [0.5, 0.5]\n\
                    [material]\nkind = \"rve\"\n";
        let scene = Scene::parse(text, "default.toml").unwrap();
        let Material::Rve(rve) = &scene.material else { panic!("another material") };
        (rve.parameters.clone(), rve.seeds(scene.seed).collect())
    }

    /// The inverse of [`unpacked`], with zeros, which need no room, in place of what [`set_constants`] sets.
    fn packed(mut packings: Packings) -> Vec<u8> {
        for packing in packings.values_mut() {
            for disc in &mut packing.discs {
                (disc.inv_mass, disc.inv_inertia) = (0.0, 0.0);
            }
            for pair in &mut packing.neighbours.pairs {
                pair.dashpot = 0.0;
            }
        }
        let mut file = ZlibEncoder::new(Vec::new(), Compression::best());
        file.write_all(&postcard::to_stdvec(&packings).unwrap()).unwrap();
        file.finish().unwrap()
    }

    #[test]
    #[ignore = "writes dempm/assets/packings.bin"]
    fn make_the_packings_that_ship() {
        let (p, seeds) = default_scene();
        let make =
            |&seed: &u64| (consolidated_key(&p, seed).unwrap(), consolidate(&p, seed).unwrap());
        let file = packed(seeds.par_iter().map(make).collect());
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/packings.bin"), file).unwrap();
    }

    #[test]
    fn those_of_default_scenes_ship_and_no_others() {
        let (p, seeds) = default_scene();
        let missing = seeds.iter().filter(|&&seed| !has(&consolidated_key(&p, seed).unwrap()));
        let missing = missing.count();
        let others = PACKINGS.len() + missing - seeds.len();
        assert_eq!(
            (missing, others),
            (0, 0),
            "packings that are missing from assets/packings.bin, and others in it; {COMMAND} writes it anew"
        );
    }

    /// The two with the fewest steps of all.
    #[test]
    fn they_have_the_bits_that_they_have_when_they_are_made() {
        let (p, seeds) = default_scene();
        for k in [0, 1] {
            let shipped = packing(&consolidated_key(&p, seeds[k]).unwrap(), &p.grains).unwrap();
            let made = consolidate(&p, seeds[k]).unwrap();
            // As bytes, zeros with different signs differ.
            let bytes = |packing| postcard::to_stdvec(packing).unwrap();
            assert!(bytes(&shipped) == bytes(&made), "seed {}: {COMMAND}", seeds[k]);
        }
    }
}
