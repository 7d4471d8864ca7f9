//! Macro steps between two frames.

/// Macro steps that a model is asked for.
pub(super) struct Span {
    /// Completed steps.
    pub first: usize,
    /// Macro step (s).
    pub dt: f64,
    /// Steps to the next frame.
    pub to_frame: usize,
    /// Steps after it that may already be begun.
    pub ahead: usize,
}
