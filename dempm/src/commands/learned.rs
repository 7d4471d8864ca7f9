//! Learned models, by the program `surrogate`.
//!
//! Its crate builds on this one. So it is called as a program, as git calls its commands; a trait would need a third
//! program that links both.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use files::{INTERRUPTED, is_quiet, write_text};
use miette::{Context, IntoDiagnostic, bail};

use crate::choose::Learned;
use crate::dataset::DatasetError;
use crate::device::Device;
use crate::run::SessionError;
use crate::scene::Scene;
use crate::trajectory::Trajectory;

/// Name of the program.
const PROGRAM: &str = "surrogate";

/// A model file, and the program that knows what to do with it.
pub struct Network {
    program: PathBuf,
    model: PathBuf,
    device: Device,
}

/// How a prediction ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Predicted {
    /// It is written.
    Now,
    /// It was there.
    Before,
    /// The file holds the frames before the interruption.
    Interrupted,
}

impl Network {
    /// A model that computes on a device.
    ///
    /// # Errors
    /// If the file or the program is not there.
    pub fn new(model: &Path, device: Device) -> miette::Result<Self> {
        if !model.is_file() {
            bail!("--learned {}: there is no such file", model.display());
        }
        let Some(program) = find() else {
            bail!(
                help = "build it: `cargo build --release --package surrogate`",
                "--learned needs the program `{PROGRAM}`, which is neither beside `dempm` nor in PATH"
            );
        };
        let model = model.canonicalize().into_diagnostic()?;
        Ok(Self { program, model, device })
    }

    /// What the model expects of a scene.
    ///
    /// # Errors
    /// If it cannot predict the scene.
    pub fn expect(&self, scene: &Scene) -> miette::Result<Learned> {
        let folder = tempfile::tempdir().into_diagnostic()?;
        let mut command = self.command("expect", scene, folder.path())?;
        let output = command.arg("--json").stdout(Stdio::piped()).output();
        let output =
            output.into_diagnostic().wrap_err_with(|| self.program.display().to_string())?;
        if !output.status.success() {
            bail!("{}: no expectation from {}", scene.name, self.model.display());
        }
        serde_json::from_slice(&output.stdout)
            .into_diagnostic()
            .wrap_err_with(|| format!("{}: not the answer of this version", self.program.display()))
    }

    /// Predicts a scene into a trajectory file. With `resume`, a finished prediction of the scene stays, and an
    /// unfinished one is made again.
    ///
    /// # Errors
    /// If the file is in the way or of another scene, or the prediction fails.
    pub fn predict(
        &self,
        scene: &Scene,
        output: &Path,
        resume: bool,
        overwrite: bool,
    ) -> miette::Result<Predicted> {
        let exists = output.exists();
        if exists && resume {
            let before = Trajectory::open(output)?;
            if before.header().scene != scene.text {
                return Err(DatasetError::OtherScene { path: output.to_owned() }.into());
            }
            if before.status() == "finished" {
                return Ok(Predicted::Before);
            }
        }
        if exists && !resume && !overwrite {
            return Err(SessionError::Exists { path: output.to_owned() }.into());
        }
        let folder = tempfile::tempdir().into_diagnostic()?;
        let mut command = self.command("rollout", scene, folder.path())?;
        command.arg("--output").arg(output).arg("--overwrite").stdout(Stdio::null());
        let status = command.status().into_diagnostic()?;
        match status.code() {
            Some(0) => Ok(Predicted::Now),
            Some(code) if code == i32::from(INTERRUPTED) => Ok(Predicted::Interrupted),
            _ => bail!("{}: no prediction from {}", scene.name, self.model.display()),
        }
    }

    /// A command of the program on a scene that is written into `folder`. Errors and progress go to the standard error
    /// stream.
    fn command(&self, name: &str, scene: &Scene, folder: &Path) -> miette::Result<Command> {
        let file = folder.join(Path::new(&scene.name).file_name().unwrap_or(OsStr::new("scene")));
        write_text(&file, &scene.text)?;
        let mut command = Command::new(&self.program);
        command.arg(name).arg(&self.model).arg("--scene").arg(file);
        command.arg(format!("--device={}", self.device));
        if is_quiet() {
            command.arg("--quiet");
        }
        Ok(command)
    }
}

/// The program beside this one, or the first in the search path.
fn find() -> Option<PathBuf> {
    let name = format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX);
    let own = std::env::current_exe().ok();
    let beside = own.as_deref().and_then(Path::parent).map(Path::to_owned);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = beside.into_iter().chain(std::env::split_paths(&path));
    folders.map(|folder| folder.join(&name)).find(|program| program.is_file())
}
