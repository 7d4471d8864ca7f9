//! Work that may be interrupted anywhere: how it begins, how it continues, what it leaves.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::campaign::{Finding, Promise, empty, workplace};
use crate::fixtures::{TRAIN, arrays, copy};
use crate::program::{Program, program};

/// Names of all files of a folder but those of the cache, and what a trace of system calls left.
fn files(folder: &Path) -> BTreeSet<String> {
    fn add(folder: &Path, before: &str, found: &mut BTreeSet<String>) {
        for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap()) {
            let name = format!("{before}{}", entry.file_name().to_string_lossy());
            match entry.path().is_dir() {
                true => add(&entry.path(), &format!("{name}/"), found),
                false => drop(found.insert(name)),
            }
        }
    }
    let mut found = BTreeSet::new();
    add(folder, "", &mut found);
    found.retain(|name| !name.starts_with("cache/") && name != "calls.txt");
    found
}

/// A kind of work.
#[derive(Clone, Copy, Debug)]
pub enum Job {
    Run,
    Dataset,
    Train,
}

/// What a job leaves: arrays of trajectories, or whole files.
pub type Results = BTreeMap<&'static str, Vec<u8>>;

impl Job {
    pub const ALL: [Self; 3] = [Self::Run, Self::Dataset, Self::Train];

    /// Puts its inputs into a folder.
    pub fn prepare(self, folder: &Path) {
        match self {
            Self::Run => copy(&["scene.toml", "cache"], folder),
            Self::Dataset => copy(&["mu-i.toml", "list.toml"], folder),
            Self::Train => copy(&["training.toml", "data"], folder),
        }
    }

    /// Begins, with as many checkpoints as it can.
    pub fn begin(self, folder: &Path) -> Program {
        self.with(folder, "")
    }

    /// Continues after an interruption.
    pub fn resume(self, folder: &Path) -> Program {
        match self {
            Self::Dataset => self.with(folder, "--resume"),
            // What was killed before its first checkpoint begins again.
            Self::Run | Self::Train if self.has_begun(folder) => self.with(folder, "--resume"),
            Self::Run | Self::Train => self.with(folder, "--overwrite"),
        }
    }

    fn has_begun(self, folder: &Path) -> bool {
        let checkpoint =
            if matches!(self, Self::Run) { "out.h5.ckpt" } else { "out/checkpoint.bin" };
        folder.join(checkpoint).exists()
    }

    fn with(self, folder: &Path, more: &str) -> Program {
        let line = match self {
            Self::Run => "dempm run scene.toml -o out.h5 --device cpu",
            Self::Dataset => "dempm dataset list.toml -o out --device cpu",
            Self::Train => &format!("{TRAIN} -o out"),
        };
        program(&format!("{line} --checkpoint-interval 0 {more}"), folder)
    }

    /// What it has left in a folder.
    pub fn results(self, folder: &Path) -> Result<Results, Finding> {
        let file = |name: &'static str| match fs::read(folder.join(name)) {
            Ok(bytes) => Ok((name, bytes)),
            Err(error) => Promise::NothingLost.broken(format!("{name}: {error}")),
        };
        let trajectory = |name: &'static str| Ok((name, arrays(name, folder)?));
        match self {
            Self::Run => ["out.h5"].into_iter().map(trajectory).collect(),
            Self::Dataset => {
                let names = [
                    "out/train/000.h5",
                    "out/train/001.h5",
                    "out/valid/000.h5",
                    "out/valid/001.h5",
                    "out/test/000.h5",
                ];
                names.into_iter().map(trajectory).collect()
            }
            Self::Train => {
                let names = [
                    "out/last.safetensors",
                    "out/best.safetensors",
                    "out/log.csv",
                    "out/validation.csv",
                ];
                names.into_iter().map(file).collect()
            }
        }
    }

    /// What it leaves if nothing happens.
    pub fn undisturbed(self) -> &'static Results {
        static KNOWN: [OnceLock<Results>; 3] = [const { OnceLock::new() }; 3];
        KNOWN[self as usize].get_or_init(|| {
            let folder = self.undisturbed_folder();
            empty(&folder);
            self.prepare(&folder);
            let ended = self.begin(&folder).run();
            assert!(ended.succeeded(), "{}", ended.report("an undisturbed job"));
            self.results(&folder).unwrap_or_else(|finding| panic!("{}", finding.what))
        })
    }

    /// Continues to the end, and compares what is then there.
    pub fn finish(self, folder: &Path, how: &str) -> Result<(), Finding> {
        let ended = self.resume(folder).run();
        ended.is_sound()?;
        if !ended.succeeded() {
            return Promise::Resumable.broken(ended.report(how));
        }
        if self.results(folder)? != *self.undisturbed() {
            return Promise::Resumable.broken(ended.report(&format!("{how}: another result")));
        }
        let (left, usual) = (files(folder), files(&self.undisturbed_folder()));
        let more: Vec<_> = left.difference(&usual).collect();
        if !more.is_empty() {
            return Promise::Tidy.broken(ended.report(&format!("{how}: left behind {more:?}")));
        }
        Ok(())
    }

    fn undisturbed_folder(self) -> PathBuf {
        workplace().join(format!("undisturbed-{self:?}"))
    }
}
