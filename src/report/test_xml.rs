//! A strict little reader that tells whether a text is well-formed XML.

/// Asserts that tags balance, attributes are quoted, entities are known and no number is missing.
#[track_caller]
pub(super) fn assert_well_formed(text: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = text;
    while let Some(start) = rest.find('<') {
        assert_entities(&rest[..start]);
        assert!(!rest[..start].contains('>'), "loose > in {:?}", &rest[..start]);
        rest = &rest[start + 1..];
        if let Some(after) = rest.strip_prefix("!DOCTYPE") {
            rest = &after[after.find('>').expect("doctype ends") + 1..];
            continue;
        }
        if rest.starts_with('?') {
            rest = &rest[rest.find("?>").expect("declaration ends") + 2..];
            continue;
        }
        // A quoted attribute may hold no raw '<' or '>' after escaping, so the next '>' ends the tag.
        let end = rest.find('>').expect("tag ends");
        let tag = &rest[..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name.trim()), "closing tag");
            continue;
        }
        let is_empty = tag.ends_with('/');
        let tag = tag.trim_end_matches('/');
        assert_eq!(tag.matches('"').count() % 2, 0, "quotes in <{tag}>");
        assert_entities(tag);
        let name = tag.split_whitespace().next().expect("tag has a name");
        if name == "style" {
            rest = &rest[rest.find("</style>").expect("style ends") + "</style>".len()..];
            continue;
        }
        if !is_empty {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "unclosed: {open:?}");
    assert!(rest.trim().is_empty(), "text after the end: {rest:?}");
    assert!(!text.contains("NaN"), "a number is missing");
    for (at, _) in text.match_indices("inf") {
        let around = |c: Option<char>| c.is_some_and(char::is_alphabetic);
        let is_word = around(text[..at].chars().next_back()) || around(text[at + 3..].chars().next());
        assert!(is_word, "infinity at {:?}", text[at..].chars().take(40).collect::<String>());
    }
}

fn assert_entities(text: &str) {
    for part in text.split('&').skip(1) {
        let entity = part.split(';').next().unwrap_or("");
        let is_known = matches!(entity, "amp" | "lt" | "gt" | "quot" | "#39");
        assert!(is_known && part.len() > entity.len(), "entity &{part}");
    }
}
