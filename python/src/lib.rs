//! The native half of the Python package `dempm`: what the package in Python cannot do itself.

mod check;
mod constraints;
mod element;
mod failure;
mod material;
mod programs;
mod run;
mod scene;
mod supervisor;

#[pyo3::pymodule]
mod _dempm {
    #[pymodule_export]
    use super::check::{check, choose};
    #[pymodule_export]
    use super::constraints::Constraints;
    #[pymodule_export]
    use super::element::element;
    #[pymodule_export]
    use super::failure::Error;
    #[pymodule_export]
    use super::material::material;
    #[pymodule_export]
    use super::programs::{command, main};
    #[pymodule_export]
    use super::run::run;
    #[pymodule_export]
    use super::scene::{scene_values, toml_text, toml_values};
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name that Python expects")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
