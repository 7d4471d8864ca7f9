//! How one run ended, and what the program said about it.

/// The end of one run.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It did what it should, and there was nothing to say.
    Stable,
    /// It may be right, and the program said what is doubtful.
    Warned { message: String },
    /// It is wrong, and the program said so.
    Failed { message: String },
    /// It is wrong, and the program said nothing.
    Silent { symptom: String },
}

/// The kinds of [`Outcome`], from good to bad.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Stable,
    Warned,
    Failed,
    Silent,
}

impl Outcome {
    /// The outcome of a run that is wrong if there is a `symptom`, about which the program `said`
    /// something or nothing.
    pub fn of(symptom: Option<String>, said: Option<String>) -> Self {
        match (symptom, said) {
            (None, None) => Self::Stable,
            (None, Some(message)) => Self::Warned { message },
            (Some(symptom), Some(said)) => Self::Failed { message: format!("{symptom}: “{said}”") },
            (Some(symptom), None) => Self::Silent { symptom },
        }
    }

    pub fn kind(&self) -> Kind {
        match self {
            Self::Stable => Kind::Stable,
            Self::Warned { .. } => Kind::Warned,
            Self::Failed { .. } => Kind::Failed,
            Self::Silent { .. } => Kind::Silent,
        }
    }

    /// Whether the result can be used: stable or warned of.
    pub fn works(&self) -> bool {
        self.kind() <= Kind::Warned
    }

    /// What was said, or the symptom about which nothing was.
    pub fn text(&self) -> &str {
        match self {
            Self::Stable => "",
            Self::Warned { message } | Self::Failed { message } => message,
            Self::Silent { symptom } => symptom,
        }
    }
}

impl Kind {
    pub const ALL: [Self; 4] = [Self::Stable, Self::Warned, Self::Failed, Self::Silent];

    pub fn name(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::Warned => "warned",
            Self::Failed => "failed",
            Self::Silent => "failed silently",
        }
    }
}
