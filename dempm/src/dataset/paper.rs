//! The scenes of the paper, compiled into the program.

use super::split::Split;

/// Split, name and text of the files in `scenes/paper`.
pub(super) const SCENES: [(Split, &str, &str); 39] = {
    macro_rules! scenes {
        ($($split:ident $folder:literal: $($name:literal)*;)*) => {
            [$($((
                Split::$split,
                $name,
                include_str!(concat!("../../../scenes/paper/", $folder, "/", $name, ".toml")),
            )),*),*]
        };
    }
    scenes! {
        Train "train": "x0y0-v00" "x0y0-v05" "x0y1-v50" "x0y1-v55" "x0y2-v00" "x0y2-v05"
            "x0y3-v55" "x1y0-v50" "x1y0-v55" "x1y1-v00" "x1y1-v05" "x1y2-v50" "x1y2-v55"
            "x1y3-v00" "x2y0-v00" "x2y0-v05" "x2y1-v50" "x2y1-v55" "x2y2-v00" "x2y2-v05"
            "x2y3-v50" "x3y0-v55" "x3y1-v00" "x3y2-v50" "x3y3-v05";
        Valid "valid": "case1" "case2" "case3" "case4" "case5";
        Test "test": "col10x2" "col2x2" "col2x2twins" "col3x3barriers" "col5x2" "col5x3"
            "col5x4" "col5x5" "penetration";
    }
};

/// The text of a scene of the paper, such as `col5x5`.
pub fn paper_scene(name: &str) -> Option<&'static str> {
    SCENES.iter().find(|scene| scene.1 == name).map(|scene| scene.2)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn every_file_is_in_the_program() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/paper");
        for split in Split::ALL {
            let mut files: Vec<String> = std::fs::read_dir(folder.join(split.name()))
                .unwrap()
                .map(|entry| entry.unwrap().path().file_stem().unwrap().display().to_string())
                .collect();
            files.sort();
            let known: Vec<_> = SCENES.iter().filter(|s| s.0 == split).map(|s| s.1).collect();
            assert_eq!(known, files);
        }
        let count = |split| SCENES.iter().filter(|s| s.0 == split).count();
        assert_eq!(Split::ALL.map(count), [25, 5, 9]);
    }
}
