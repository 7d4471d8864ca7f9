//! How one run ended, and what the program said about it.

use serde::{Deserialize, Serialize};

use crate::map;

/// The end of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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

impl Outcome {
    /// The outcome of a run that is wrong if there is a `symptom`, about which the program `said`
    /// something or nothing.
    pub fn of(symptom: Option<String>, said: Option<String>) -> Self {
        match (symptom, said) {
            (None, None) => Self::Stable,
            (None, Some(message)) => Self::Warned { message },
            (Some(symptom), Some(said)) => {
                Self::Failed { message: format!("{symptom}: “{said}”") }
            }
            (Some(symptom), None) => Self::Silent { symptom },
        }
    }

    /// As the report's maps show it.
    pub fn kind(&self) -> map::Outcome {
        match self {
            Self::Stable => map::Outcome::Stable,
            Self::Warned { .. } => map::Outcome::Warned,
            Self::Failed { .. } => map::Outcome::Failed,
            Self::Silent { .. } => map::Outcome::Silent,
        }
    }

    /// Whether the result can be used: stable or warned of.
    pub fn works(&self) -> bool {
        matches!(self, Self::Stable | Self::Warned { .. })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outcome_is_judged_by_symptom_and_message() {
        let text = |t: &str| Some(t.to_owned());
        assert_eq!(Outcome::of(None, None), Outcome::Stable);
        let warned = Outcome::of(None, text("doubt"));
        assert!(warned.works() && warned.text() == "doubt");
        let failed = Outcome::of(text("wrong"), text("error"));
        assert!(!failed.works() && failed.text() == "wrong: “error”");
        assert_eq!(Outcome::of(text("wrong"), None).kind(), map::Outcome::Silent);
    }
}
