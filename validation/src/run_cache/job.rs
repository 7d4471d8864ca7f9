//! What is to be run.

/// A run of a program of the suite.
pub struct Job<'a> {
    /// Subcommand of `validation` that runs the program.
    pub subcommand: &'a str,
    /// Name of the program, as a user would type it.
    pub program: &'a str,
    /// Everything that the result depends on besides `subcommand` and `input`.
    pub key: String,
    /// The input file.
    pub input: Option<Input<'a>>,
    /// Name of the output file.
    pub output: &'a str,
    /// Arguments after the input; `-o OUTPUT` is appended.
    pub arguments: Vec<String>,
    /// Whether the program can continue from a checkpoint (`--resume`).
    pub resumes: bool,
}

/// An input file that is written for a run.
pub struct Input<'a> {
    /// Name of the file.
    pub name: &'a str,
    /// Its contents.
    pub text: &'a str,
    /// The option that takes it; `None` for a positional argument.
    pub option: Option<&'a str>,
}
