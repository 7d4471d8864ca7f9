//! The programs under attack: damaged files, mutated texts, random scenes, kills, failing disks and
//! closed terminals; and their readers within this process.
//!
//! Each test attacks until its share of `DEMPM_ATTACK_SECONDS` (60) is over; every attack draws its
//! random numbers from `DEMPM_ATTACK_SEED` (1) and its own number, and `DEMPM_ATTACK_ONLY` repeats
//! one. `docs/robustness.md` says what is promised and how to attack for hours.
#![cfg(unix)]

mod campaign;
mod damage;
mod disks;
mod fixtures;
mod fuzz;
mod in_process;
mod jobs;
mod kills;
mod mutation;
mod program;
mod scenes;
mod structure;
mod terminals;
mod texts;
