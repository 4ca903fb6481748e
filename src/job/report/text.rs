//! Text into a page.

/// The five characters that mean something in HTML and XML, escaped; control characters, which neither allows, as
/// U+FFFD. Safe as text and within quoted attributes.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            '\n' | '\t' => safe.push(c),
            c if c.is_control() => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// The `<svg …>…</svg>` of an SVG file, without what comes before and after it (prolog, comments), which has no
/// place within a page. `None` if there is none.
pub fn svg_element(file: &str) -> Option<&str> {
    const END: &str = "</svg>";
    let start = file.match_indices("<svg").find_map(|(at, _)| {
        let next = file[at + 4..].chars().next()?;
        (next.is_whitespace() || next == '>').then_some(at)
    })?;
    let end = file.rfind(END)? + END.len();
    (start < end).then(|| &file[start..end])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn markup_becomes_text() {
        assert_eq!(
            escape("<b a=\"1\" c='2'>&\u{0}\n"),
            "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;\u{fffd}\n"
        );
    }

    #[test]
    fn only_the_element_of_an_svg_file_is_kept() {
        let file = "<?xml version=\"1.0\"?>\n<!-- <svgx> -->\n<svg id=\"a\"><g/></svg>\n";
        assert_eq!(svg_element(file), Some("<svg id=\"a\"><g/></svg>"));
        assert_eq!(svg_element("<p>no drawing</p>"), None);
        assert_eq!(svg_element("</svg><svg "), None);
    }

    proptest! {
        #[test]
        fn no_text_opens_a_tag_or_leaves_an_attribute(text in any::<String>()) {
            let safe = escape(&text);
            prop_assert!(!safe.contains(['<', '>', '"', '\'']));
            prop_assert_eq!(safe.matches('&').count(), safe.matches(';').count() - text.matches(';').count());
        }
    }
}
