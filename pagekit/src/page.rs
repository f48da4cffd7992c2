//! What pages share: one stylesheet, the frame of a document, text made safe for it.
//!
//! A page is one file without any resource from elsewhere, so that it opens offline and in ten years. It is written as HTML
//! that an XML parser reads too, which lets tests hold it to being well-formed. Colours are variables of [`STYLE`], after Okabe
//! and Ito (darker where white paper needs it), for light, dark and print; a line is distinguished from its neighbour by its
//! dashes and its markers too, a verdict by its word: nothing hangs on colour alone.

/// The stylesheet of every page.
pub const STYLE: &str = include_str!("page.css");

/// A whole page: `body` is markup, `title` is text.
#[must_use]
pub fn document(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>{}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n",
        escaped(title)
    )
}

/// Text as a page shows it, between tags and in attributes. Control characters, which a command line or a file's name may
/// hold and no page may, are shown as the sign for what cannot be shown.
#[must_use]
pub fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            '\n' | '\t' => safe.push(letter),
            '\u{fffe}' | '\u{ffff}' => safe.push(char::REPLACEMENT_CHARACTER),
            letter if letter.is_control() => safe.push(char::REPLACEMENT_CHARACTER),
            letter => safe.push(letter),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        assert_eq!(escaped("<b a=\"1\" b='2'>&"), "&lt;b a=&quot;1&quot; b=&#39;2&#39;&gt;&amp;");
        assert_eq!(escaped("a\u{1b}[31m\u{0}\n"), "a\u{fffd}[31m\u{fffd}\n");
    }

    #[test]
    fn the_stylesheet_asks_for_nothing_from_elsewhere_and_holds_nothing_that_xml_refuses() {
        for part in ["@import", "http", "//", "<", "&"] {
            assert!(!STYLE.contains(part), "{part}");
        }
        assert_eq!(STYLE.matches("url(").count(), STYLE.matches("url(#").count());
        assert_eq!(STYLE.matches('{').count(), STYLE.matches('}').count());
        for part in ["prefers-color-scheme:dark", "@media print", "tabular-nums"] {
            assert!(STYLE.contains(part), "{part}");
        }
    }
}
