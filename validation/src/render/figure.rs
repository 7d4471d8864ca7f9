//! Pictures with captions.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A picture with its caption.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// What it shows; unique within the section, since the file is named after it.
    pub title: String,
    /// How to read it.
    pub caption: String,
    /// The picture itself.
    pub picture: Picture,
    /// Whether the first screen of the page shows it too.
    #[serde(default)]
    pub cover: bool,
}

/// The picture itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Picture {
    /// Text of an SVG file.
    Svg(String),
    /// A PNG file.
    #[serde(with = "Base64")]
    Png(Vec<u8>),
    /// An animation.
    #[serde(with = "Base64")]
    Gif(Vec<u8>),
}

/// Bytes as text.
struct Base64;

impl Base64 {
    fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&STANDARD.encode(bytes))
    }

    fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
        let text = String::deserialize(deserializer)?;
        STANDARD.decode(text).map_err(serde::de::Error::custom)
    }
}

impl Picture {
    /// The suffix of its file.
    pub fn suffix(&self) -> &'static str {
        match self {
            Self::Svg(_) => "svg",
            Self::Png(_) => "png",
            Self::Gif(_) => "gif",
        }
    }

    /// The contents of its file.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::Svg(text) => text.as_bytes(),
            Self::Png(bytes) | Self::Gif(bytes) => bytes,
        }
    }
}

impl Figure {
    /// A picture with its title and caption.
    pub fn new(title: impl Into<String>, picture: Picture, caption: impl Into<String>) -> Self {
        Self { title: title.into(), caption: caption.into(), picture, cover: false }
    }

    /// Shown on the first screen of the page, too.
    #[must_use]
    pub fn on_cover(self) -> Self {
        Self { cover: true, ..self }
    }
}
