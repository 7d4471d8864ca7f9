//! The outcome of a run: right or wrong, with or without a message.

use serde::{Deserialize, Serialize};

/// The outcome of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// Correct, without a message.
    Stable,
    /// Correct, with a warning.
    Warned {
        /// The warning.
        message: String,
    },
    /// Wrong, with a warning or an error.
    Failed {
        /// What is wrong, and the program's message.
        message: String,
    },
    /// Wrong, without a message.
    Silent {
        /// What is wrong.
        symptom: String,
    },
}

impl Outcome {
    /// The outcome of a run that is wrong if there is a `symptom`; `said` is the program's message.
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

    /// The first wrong outcome of a sweep, or the last one if none is wrong.
    pub(super) fn first_failure<'o>(sweep: impl IntoIterator<Item = &'o Self>) -> Self {
        let mut last = &Self::Stable;
        for outcome in sweep {
            last = outcome;
            if !outcome.works() {
                break;
            }
        }
        last.clone()
    }

    /// Whether the result is correct.
    pub fn works(&self) -> bool {
        matches!(self, Self::Stable | Self::Warned { .. })
    }

    /// The message, or the symptom without a message; empty if stable.
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
        assert!(matches!(Outcome::of(text("wrong"), None), Outcome::Silent { .. }));
    }
}
