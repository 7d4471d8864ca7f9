//! Errors of charts, figures and animations.

/// A picture that could not be drawn or encoded.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PlotError {
    /// The built-in font cannot be loaded.
    #[error("the built-in font cannot be loaded")]
    Font,
    /// The drawing library refuses.
    #[error("cannot draw {what}: {reason}")]
    Draw {
        /// The chart or figure.
        what: String,
        /// The library's reason.
        reason: String,
    },
    /// A side that the format of the animation cannot hold.
    #[error("{0} pixels are too many for a GIF: at most 65535 in each direction")]
    Size(u32),
    /// The animation could not be written.
    #[error("cannot write the GIF")]
    Gif(#[from] gif::EncodingError),
    /// The file could not be written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}
