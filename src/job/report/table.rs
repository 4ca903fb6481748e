//! All figures, as a table.

use std::fmt::Write as _;

use serde_json::Value;

use super::text::escape;

/// Every leaf of a JSON object as a row, in the object's own order: nested keys joined, one heading for each key of
/// the outermost object that holds more than one figure.
pub fn table(figures: &Value) -> String {
    let mut html = String::from("<table class=\"figures\">");
    let mut rows = Vec::new();
    match figures {
        Value::Object(map) => {
            // Plain figures first: they would otherwise stand under the heading of the group before.
            let (groups, plain): (Vec<_>, Vec<_>) = map.iter().partition(|(_, v)| is_group(v));
            for (key, value) in &plain {
                leaves(key, value, &mut rows);
            }
            body(&mut html, None, &rows);
            for (key, value) in groups {
                rows.clear();
                leaves("", value, &mut rows);
                body(&mut html, Some(key), &rows);
            }
        }
        other => {
            leaves("value", other, &mut rows);
            body(&mut html, None, &rows);
        }
    }
    html.push_str("</table>");
    html
}

fn body(html: &mut String, heading: Option<&str>, rows: &[(String, String)]) {
    if rows.is_empty() {
        return;
    }
    html.push_str("<tbody>");
    if let Some(heading) = heading {
        let _ = write!(
            html,
            "<tr class=\"group\"><th colspan=\"2\" scope=\"colgroup\">{}</th></tr>",
            escape(&plain(heading))
        );
    }
    for (key, value) in rows {
        let _ = write!(
            html,
            "<tr><th scope=\"row\">{}</th><td>{}</td></tr>",
            escape(&plain(key)),
            escape(value)
        );
    }
    html.push_str("</tbody>");
}

/// True if a value takes more than one row.
fn is_group(value: &Value) -> bool {
    match value {
        Value::Object(map) => !map.is_empty(),
        Value::Array(list) => list.iter().any(|v| v.is_object() || v.is_array()),
        _ => false,
    }
}

fn leaves(key: &str, value: &Value, rows: &mut Vec<(String, String)>) {
    let inner = |name: &str| {
        if key.is_empty() {
            name.to_owned()
        } else {
            format!("{key} › {name}")
        }
    };
    match value {
        Value::Object(map) if !map.is_empty() => {
            for (name, value) in map {
                leaves(&inner(name), value, rows);
            }
        }
        Value::Array(list) if is_group(value) => {
            for (i, value) in list.iter().enumerate() {
                leaves(&inner(&(i + 1).to_string()), value, rows);
            }
        }
        Value::Array(list) => {
            let parts: Vec<String> = list.iter().map(scalar).collect();
            let text = if parts.is_empty() {
                "none".into()
            } else {
                parts.join(", ")
            };
            rows.push((key.to_owned(), text));
        }
        other => rows.push((key.to_owned(), scalar(other))),
    }
}

fn scalar(value: &Value) -> String {
    match value {
        Value::Null => "–".into(),
        Value::Bool(true) => "yes".into(),
        Value::Bool(false) => "no".into(),
        Value::String(text) => text.clone(),
        Value::Object(_) => "none".into(),
        other => other.to_string(),
    }
}

/// A key as words: `cut_length_mm` → `cut length mm`.
fn plain(key: &str) -> String {
    key.replace('_', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_leaf_has_its_row() {
        let html = table(&serde_json::json!({
            "triangles": 1500,
            "quality": { "opening": [1.0, 1.4, 2.0], "distance_max": { "value": 0.064, "at_mm": [1, 2, 3] } },
            "cuts": [{ "length_mm": 3.5 }, { "length_mm": 4.5 }],
            "ok": true, "nothing": null, "empty": {}, "name": "<mask>"
        }));
        for row in [
            "<th scope=\"row\">triangles</th><td>1500</td>",
            "<th scope=\"row\">opening</th><td>1.0, 1.4, 2.0</td>",
            "<th scope=\"row\">distance max › at mm</th><td>1, 2, 3</td>",
            "<th scope=\"row\">2 › length mm</th><td>4.5</td>",
            "<th scope=\"row\">ok</th><td>yes</td>",
            "<th scope=\"row\">nothing</th><td>–</td>",
            "<th scope=\"row\">empty</th><td>none</td>",
            "<td>&lt;mask&gt;</td>",
        ] {
            assert!(html.contains(row), "{row}\n{html}");
        }
        assert_eq!(html.matches("<tr>").count(), 10);
        assert_eq!(html.matches("class=\"group\"").count(), 2);
    }

    #[test]
    fn a_value_alone_is_a_table_too() {
        assert!(table(&Value::from(3)).contains("<td>3</td>"));
        assert_eq!(
            table(&serde_json::json!({})),
            "<table class=\"figures\"></table>"
        );
    }
}
