//! Texts as HTML.

/// Text with what stands between backticks as code.
pub(super) fn inline(text: &str) -> String {
    let parts = text.split('`').enumerate().map(|(k, part)| match k % 2 {
        0 => escape(part),
        _ => format!("<code>{}</code>", escape(part)),
    });
    parts.collect()
}

/// Text without the characters that HTML interprets.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_cannot_break_the_page() {
        assert_eq!(
            inline("a < b & `x > \"y\"`"),
            "a &lt; b &amp; <code>x &gt; &quot;y&quot;</code>"
        );
    }
}
