//! The DEM against YADE, where that is installed.

use std::process::Command;

use miette::{IntoDiagnostic, WrapErr, bail};

use crate::block::Block;
use crate::context::Context;
use crate::section::Section;

/// One packing, one shear path, two codes.
pub struct Yade;

/// The comparison and its part that YADE runs; also commands of their own.
const SCRIPTS: [(&str, &str); 2] = [
    ("compare.py", include_str!("../../yade/compare.py")),
    ("shear.py", include_str!("../../yade/shear.py")),
];
/// About, s.
const SECONDS: f64 = 120.0;

impl Section for Yade {
    fn title(&self) -> &'static str {
        "Constant-volume shear against YADE"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let found = Command::new("yade").arg("--version").output();
        let Ok(version) = found else {
            return Ok(vec![Block::missing(
                "The comparison with YADE",
                "the program `yade` is not installed.",
                "On Debian: `apt-get install yade`.",
            )]);
        };
        let version = String::from_utf8_lossy(&version.stdout).trim().to_owned();
        let key = format!("{version}\n{}\n{}", SCRIPTS[0].1, SCRIPTS[1].1);
        let program = context.work.program().to_owned();
        let said: String = context.cached("yade", &key, SECONDS, || {
            let folder = tempfile::tempdir().into_diagnostic()?;
            for (name, text) in SCRIPTS {
                std::fs::write(folder.path().join(name), text).into_diagnostic()?;
            }
            let output = Command::new("python3")
                .arg(folder.path().join("compare.py"))
                .arg("--dempm")
                .arg(&program)
                .output()
                .into_diagnostic()
                .wrap_err("cannot start python3")?;
            if !output.status.success() {
                bail!("compare.py: {}", String::from_utf8_lossy(&output.stderr).trim());
            }
            Ok(String::from_utf8_lossy(&output.stdout).into_owned())
        })?;
        Ok(vec![
            Block::text(format!(
                "One dense packing at 20 kPa, simple shear at constant volume, the same steps in both \
                 codes (`validation/yade/compare.py`, {version}), one thread each. Chaos parts the two \
                 at strains above 1 %: from there on only means can agree.",
            )),
            Block::Quote(said),
        ])
    }
}
