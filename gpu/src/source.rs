//! A CUDA source.

/// A CUDA source with the definitions that it needs.
#[derive(Clone, Debug)]
pub struct Source {
    /// File name in messages of the compiler.
    pub name: &'static str,
    /// CUDA C++, the structs that it shares with Rust included.
    pub text: String,
    /// Preprocessor definitions `NAME=value`.
    pub defines: Vec<String>,
}

impl Source {
    /// With another preprocessor definition.
    #[must_use]
    pub fn define(mut self, name: &str, value: usize) -> Self {
        self.defines.push(format!("{name}={value}"));
        self
    }
}
