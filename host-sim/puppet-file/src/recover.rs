//! Reading a puppet.toml that is not right, so that all its mistakes are told and not only the first.
//!
//! serde stops at the first key that is unknown, missing or of another type. So that key is taken out, or a filler is put in, and
//! the rest is read again. What is said about a filler is told to nobody.

use crate::file::File;
use crate::place::FILLER;
use serde::Deserialize;
use std::borrow::Cow;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer, Error};

/// Most mistakes that are told of the keys of a file.
const MOST: usize = 100;

/// What there is of a file, and all that is wrong with its keys and the types of their values.
pub(crate) fn read(text: &str) -> (Option<File>, Vec<Error>) {
    let (mut table, mut mistakes) = DeTable::parse_recoverable(text);
    // What could not be read is not missing.
    let broken = !mistakes.is_empty();
    let mut fillers = 0;
    // A value that is taken out is missing then.
    let mut taken_out: Vec<String> = Vec::new();
    while mistakes.len() < MOST && fillers < MOST {
        let error = match File::deserialize(Deserializer::from(table.clone())) {
            Ok(file) => return (Some(file), mistakes),
            Err(error) => error,
        };
        let Some(span) = error.span() else {
            mistakes.push(error);
            break;
        };
        let missing = error.message().strip_prefix("missing field `").and_then(|rest| rest.split('`').next());
        if let Some(missing) = missing {
            let missing = missing.to_owned();
            fillers += 1;
            if !fill(table.get_mut(), &span, &missing) && !fill_here(table.get_mut(), &missing) {
                mistakes.push(error);
                break;
            }
            if !broken && !taken_out.contains(&at(&span, &missing)) {
                mistakes.push(error);
            }
            continue;
        }
        let Some((table_span, key)) = take_out(table.get_mut(), &(0..text.len()), &span) else {
            mistakes.push(error);
            break;
        };
        taken_out.push(at(&table_span, &key));
        mistakes.push(error);
    }
    (None, mistakes)
}

/// What a key of a table is called here.
fn at(table: &Range<usize>, key: &str) -> String {
    format!("{} {key}", table.start)
}

/// Takes out the innermost entry that holds `span`; gives its table's place and its key.
fn take_out(
    table: &mut DeTable<'_>,
    own: &Range<usize>,
    span: &Range<usize>,
) -> Option<(Range<usize>, String)> {
    let holds = |range: &Range<usize>| range.start <= span.start && span.end <= range.end;
    let mut found = None;
    for (key, value) in table.iter_mut() {
        let place = value.span();
        match value.get_mut() {
            DeValue::Table(inner) if holds(&place) => {
                if let Some(deeper) = take_out(inner, &place, span) {
                    return Some(deeper);
                }
            }
            DeValue::Array(items) => {
                for item in items.iter_mut() {
                    let place = item.span();
                    if let DeValue::Table(inner) = item.get_mut()
                        && let Some(deeper) = take_out(inner, &place, span)
                    {
                        return Some(deeper);
                    }
                }
            }
            _ => {}
        }
        if holds(&key.span()) || holds(&place) {
            found = Some(key.get_ref().clone());
        }
    }
    let key = found?;
    table.remove(key.as_ref());
    Some((own.clone(), key.into_owned()))
}

/// Puts a filler into the table with this place.
fn fill(table: &mut DeTable<'_>, span: &Range<usize>, key: &str) -> bool {
    for (_, value) in table.iter_mut() {
        let here = value.span() == *span;
        match value.get_mut() {
            DeValue::Table(inner) => {
                if here {
                    return fill_here(inner, key);
                }
                if fill(inner, span, key) {
                    return true;
                }
            }
            DeValue::Array(items) => {
                for item in items.iter_mut() {
                    let here = item.span() == *span;
                    if let DeValue::Table(inner) = item.get_mut()
                        && (here && fill_here(inner, key) || !here && fill(inner, span, key))
                    {
                        return true;
                    }
                }
            }
            _ => {}
        }
    }
    false
}

/// Puts a filler into a table that lacks the key.
fn fill_here(table: &mut DeTable<'_>, key: &str) -> bool {
    let text = match key {
        // No name that a file can have.
        "name" => r#""\u0000""#,
        "servo_hz" => "50",
        "baud" => "1000000",
        "kind" => "\"dynamixel\"",
        "bone" | "against" => "\"world\"",
        "axis" => "\"x\"",
        "id" => "0",
        "max_speed" => "100.0",
        "joint" => "[]",
        _ => return false,
    };
    let Ok(value) = DeValue::parse(text) else { return false };
    let key = Spanned::new(FILLER, Cow::Owned(key.to_owned()));
    table.insert(key, Spanned::new(FILLER, value.into_inner())).is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mistakes(text: &str) -> (bool, Vec<String>) {
        let (file, errors) = read(text);
        (file.is_some(), errors.iter().map(|error| error.message().to_owned()).collect())
    }

    #[test]
    fn every_key_that_is_unknown_missing_or_of_another_type_is_told_once() {
        let text = "servo_hz = 'fast'\nbaud = 1\ncolour = 'red'\n[[joint]]\nid = 300\nname = 'a'\nturn = { bone = 'hips', \
                    agaisnt = 'world', axis = 'w' }\n[[joint]]\nname = 3\nid = 4\nmax_speed = 1\n";
        let (read, mut said) = mistakes(text);
        said.sort();
        assert!(read, "{said:#?}");
        let expected = [
            "invalid type: integer `3`",
            "invalid type: string \"fast\"",
            "invalid value: integer `300`",
            "invalid value: string \"w\"",
            "missing field `against`",
            "missing field `max_speed`",
            "unknown field `agaisnt`",
            "unknown field `colour`",
        ];
        assert_eq!(said.len(), expected.len(), "{said:#?}");
        for (said, expected) in said.iter().zip(expected) {
            assert!(said.starts_with(expected), "{said}");
        }
    }

    #[test]
    fn what_is_not_toml_is_told_and_ends() {
        for text in
            ["[[joint", "a = = 1\nb = ", "", "joint = 3", "\u{0}", "[joint]\nid = 1", "[[joint]]\n[[joint]]"]
        {
            let (_, said) = mistakes(text);
            assert!(!said.is_empty() && said.len() < MOST, "{text:?}: {said:?}");
        }
    }
}
