//! Text out of files on a terminal: what would move the cursor, colour lines or turn their direction is shown as a number.

/// Characters of a word that a message shows; a path may have a few hundred.
const MOST_IN_A_WORD: usize = 300;

/// Characters of a name that a table shows.
const MOST_IN_A_NAME: usize = 60;

/// Whether a character is not to reach a terminal out of a file: control codes, and those that change the direction of
/// the text, end lines or have no width.
fn is_hidden(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

/// The text with such characters as `\u001b`, which is how JSON has them too. Lines and tabs stay.
pub fn shown(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        if is_hidden(character) && !matches!(character, '\n' | '\t') {
            out.push_str(&format!("\\u{:04x}", u32::from(character)));
        } else {
            out.push(character);
        }
    }
    out
}

/// A message: [`shown`], without words that are longer than a message should be.
pub fn message(text: &str) -> String {
    let words = text.split_inclusive([' ', '\n']);
    words.map(|word| shortened(&shown(word).replace('\t', "\\u0009"), MOST_IN_A_WORD)).collect()
}

/// [`shown`] on one line: ends of lines and tabs are numbers too.
pub fn one_line(text: &str) -> String {
    shown(text).replace('\n', "\\u000a").replace('\t', "\\u0009")
}

/// A name in a table: [`one_line`], and shortened.
pub fn name(text: &str) -> String {
    shortened(&one_line(text), MOST_IN_A_NAME)
}

fn shortened(word: &str, most: usize) -> String {
    let count = word.chars().count();
    if count <= most {
        return word.to_owned();
    }
    let tail = if word.ends_with([' ', '\n']) { &word[word.len() - 1..] } else { "" };
    let begin: String = word.chars().take(most * 2 / 3).collect();
    format!("{begin}…({count} characters){tail}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_a_terminal_is_a_number() {
        assert_eq!(shown("a\u{1b}]0;pwned\u{7}.tx\n\tb"), "a\\u001b]0;pwned\\u0007.tx\n\tb");
        assert_eq!(shown("\u{202e}abc\u{2066}\u{9b}31m\r"), "\\u202eabc\\u2066\\u009b31m\\u000d");
        assert_eq!(shown("Hüfte.rx 人形"), "Hüfte.rx 人形");
        // In JSON it is still the same string.
        let json = serde_json::json!({ "name": "\u{202e}a\u{7f}" }).to_string();
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&shown(&json)).unwrap()["name"],
            "\u{202e}a\u{7f}"
        );
    }

    #[test]
    fn long_words_and_names_are_cut() {
        let long = "x".repeat(65_536);
        let said = message(&format!("joint {long} is not there\n"));
        assert!(
            said.len() < 300 && said.contains("…(65536 characters) is not") || said.contains("(65537"),
            "{said}"
        );
        assert!(said.starts_with("joint xxx") && said.ends_with("is not there\n"));
        assert_eq!(message("bunraku: a short one\n"), "bunraku: a short one\n");
        assert_eq!(name("a\nb"), "a\\u000ab");
        assert!(name(&long).chars().count() < 70);
    }
}
