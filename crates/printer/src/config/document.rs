//! The text of a printer.cfg as sections and options, each with its line. Knows the format, not what any option means.
//!
//! Source: Klipper's public documentation (docs/Config_Reference.md, "Format of this document"): `[section]`,
//! `key: value` or `key = value`, `#` comments anywhere, `;` comments at the start of a line or after white space,
//! values continued by indentation, later settings win, and the block of `#*#` lines that `SAVE_CONFIG` appends.

use std::collections::BTreeMap;

use super::diagnostics::{Log, excerpt};

/// Longest file that is read. Real ones are a few tens of kilobytes.
pub const CONFIG_BYTES_MAX: usize = 1 << 20;

const SAVED_PREFIX: &str = "#*#";

/// One `key: value`.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) line: u32,
    pub(super) value: String,
    saved: bool,
}

/// Everything said under one section name.
#[derive(Clone, Debug)]
pub(super) struct Section {
    pub(super) name: String,
    pub(super) line: u32,
    /// By lower-case name: Klipper does not tell `pid_Kp` from `pid_kp`.
    pub(super) entries: BTreeMap<String, Entry>,
}

/// All sections by name.
#[derive(Debug, Default)]
pub(super) struct Document {
    sections: BTreeMap<String, Section>,
}

impl Document {
    /// Hands a section out; what is left at the end is what nobody knew.
    pub(super) fn take(&mut self, name: &str) -> Option<Section> {
        self.sections.remove(name)
    }

    /// The value of one option, unparsed.
    pub(super) fn peek(&self, section: &str, key: &str) -> Option<&Entry> {
        self.sections.get(section)?.entries.get(key)
    }

    /// The names of all sections of a kind, in alphabetical order.
    pub(super) fn names_starting_with(&self, prefix: &str) -> Vec<String> {
        self.sections.keys().filter(|name| name.starts_with(prefix)).cloned().collect()
    }

    /// The sections nobody took, in the order of the file.
    pub(super) fn into_rest(self) -> Vec<Section> {
        let mut rest: Vec<Section> = self.sections.into_values().collect();
        rest.sort_by_key(|section| section.line);
        rest
    }
}

/// Reads the text. Lines that make no sense become diagnostics and are left out.
pub(super) fn read(text: &str, log: &mut Log) -> Document {
    let mut reader = LineReader::default();
    if text.len() > CONFIG_BYTES_MAX {
        log.error(
            0,
            format!(
                "the file has {} bytes, more than the {CONFIG_BYTES_MAX} of the longest printer.cfg that is read; \
                 is this the right file?",
                text.len()
            ),
        );
        return reader.document;
    }
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    for (index, raw) in text.lines().enumerate() {
        // The length check above keeps the number of lines far below 2³².
        reader.line(index as u32 + 1, raw, log);
    }
    reader.document
}

#[derive(Default)]
struct LineReader {
    document: Document,
    /// Name of the section that options now go to.
    section: Option<String>,
    /// The option that indented lines now continue, and its own indentation.
    option: Option<(String, usize)>,
    in_saved_block: bool,
}

impl LineReader {
    fn line(&mut self, number: u32, raw: &str, log: &mut Log) {
        let Some(body) = self.body_of(number, raw, log) else { return };
        let body = without_comment(body).trim_end();
        let content = body.trim_start();
        if content.is_empty() {
            return;
        }
        let indent = body.len() - content.len();
        if let (Some(section), Some((key, own_indent))) = (&self.section, &self.option)
            && indent > *own_indent
        {
            if let Some(entry) = self.document.entry(section, key) {
                entry.value.push('\n');
                entry.value.push_str(content);
            }
            return;
        }
        self.option = None;
        if let Some(rest) = content.strip_prefix('[') {
            self.header(number, rest, log);
        } else {
            self.entry(number, indent, content, log);
        }
    }

    /// The part of the line that counts: the saved block is written as comments, and is none.
    fn body_of<'a>(&mut self, number: u32, raw: &'a str, log: &mut Log) -> Option<&'a str> {
        let Some(rest) = raw.strip_prefix(SAVED_PREFIX) else {
            if self.in_saved_block && !raw.trim().is_empty() {
                self.in_saved_block = false;
                self.option = None;
                log.warning(
                    number,
                    "text after the SAVE_CONFIG block: it is read, but Klipper would refuse it; move it above the block",
                );
            }
            return Some(raw);
        };
        if rest.contains("<---") && rest.contains("SAVE_CONFIG") {
            self.in_saved_block = true;
            self.section = None;
            self.option = None;
            return None;
        }
        let rest = rest.strip_prefix(' ').unwrap_or(rest);
        (self.in_saved_block && !rest.starts_with("DO NOT EDIT")).then_some(rest)
    }

    fn header(&mut self, number: u32, rest: &str, log: &mut Log) {
        self.section = None;
        let Some((name, tail)) = rest.split_once(']') else {
            log.error(number, format!("`[{}` has no closing `]`: write `[name]`", excerpt(rest)));
            return;
        };
        let name = name.split_whitespace().collect::<Vec<_>>().join(" ");
        if name.is_empty() {
            log.error(number, "a section needs a name: write `[name]`");
            return;
        }
        if !tail.trim().is_empty() {
            log.warning(
                number,
                format!("`{}` after `]` has no effect: give it a line of its own", excerpt(tail)),
            );
        }
        self.document.sections.entry(name.clone()).or_insert_with(|| Section {
            name: name.clone(),
            line: number,
            entries: BTreeMap::new(),
        });
        self.section = Some(name);
    }

    fn entry(&mut self, number: u32, indent: usize, content: &str, log: &mut Log) {
        let Some(at) = content.find([':', '=']) else {
            log.error(
                number,
                format!("`{}` is neither a section nor an option: write `name: value`", excerpt(content)),
            );
            return;
        };
        let key = content[..at].trim().to_lowercase();
        if key.is_empty() {
            log.error(
                number,
                format!("`{}` has no name before its `{}`", excerpt(content), &content[at..=at]),
            );
            return;
        }
        let Some(section) = self.section.as_ref().and_then(|name| self.document.sections.get_mut(name))
        else {
            log.error(
                number,
                format!("`{}` stands in no section: put a `[section]` line above it", excerpt(&key)),
            );
            return;
        };
        let entry =
            Entry { line: number, value: content[at + 1..].trim().to_owned(), saved: self.in_saved_block };
        let saved = entry.saved;
        if let Some(old) = section.entries.insert(key.clone(), entry)
            && old.saved == saved
        {
            log.warning(
                number,
                format!(
                    "[{}] {} is set twice: this line counts, line {} does not; delete one",
                    excerpt(&section.name),
                    excerpt(&key),
                    old.line
                ),
            );
        }
        self.option = Some((key, indent));
    }
}

impl Document {
    fn entry(&mut self, section: &str, key: &str) -> Option<&mut Entry> {
        self.sections.get_mut(section)?.entries.get_mut(key)
    }
}

fn without_comment(line: &str) -> &str {
    let mut after_space = true;
    for (at, character) in line.char_indices() {
        if character == '#' || (character == ';' && after_space) {
            return &line[..at];
        }
        after_space = character.is_whitespace();
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value<'a>(document: &'a Document, section: &str, key: &str) -> &'a str {
        &document.sections[section].entries[key].value
    }

    fn read_quietly(text: &str) -> Document {
        let mut log = Log::default();
        let document = read(text, &mut log);
        let diagnostics = log.into_diagnostics();
        assert!(diagnostics.is_empty(), "{diagnostics:?}");
        document
    }

    #[test]
    fn both_separators_comments_and_case_are_understood() {
        let document = read_quietly(
            "\u{feff}# a comment\r\n[ stepper_x ]\r\nStep_Pin: gpio2 # why\ndir_pin = !gpio3 ; why\n; whole\nserial: a;b\n",
        );
        assert_eq!(value(&document, "stepper_x", "step_pin"), "gpio2");
        assert_eq!(value(&document, "stepper_x", "dir_pin"), "!gpio3");
        assert_eq!(value(&document, "stepper_x", "serial"), "a;b");
    }

    #[test]
    fn indented_lines_continue_a_value_across_blank_lines() {
        let document = read_quietly("[a]\nk:\n  one\n\n# no\n  two\nl: 3\n");
        assert_eq!(value(&document, "a", "k"), "\none\ntwo");
        assert_eq!(value(&document, "a", "l"), "3");
    }

    #[test]
    fn a_section_may_be_continued_and_options_may_be_indented_alike() {
        let document = read_quietly("[a]\n  k: 1\n  l: 2\n[b]\nm: 3\n[a]\nn: 4\n");
        assert_eq!(value(&document, "a", "l"), "2");
        assert_eq!(value(&document, "a", "n"), "4");
        assert_eq!(document.sections["a"].line, 1);
    }

    #[test]
    fn the_saved_block_overrides_what_stands_above_it() {
        let document = read_quietly(
            "[extruder]\npid_Kp: 1\n\n#*# <---------------------- SAVE_CONFIG ---------------------->\n\
             #*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.\n#*#\n#*# [extruder]\n\
             #*# pid_kp = 22.2\n#*# points =\n#*# \t1, 2\n#*# \t3, 4\n",
        );
        assert_eq!(value(&document, "extruder", "pid_kp"), "22.2");
        assert_eq!(value(&document, "extruder", "points"), "\n1, 2\n3, 4");
    }

    #[test]
    fn saved_lines_without_their_header_are_comments() {
        let document = read_quietly("[a]\nk: 1\n#*# k = 2\n");
        assert_eq!(value(&document, "a", "k"), "1");
    }

    #[test]
    fn each_mistake_names_its_line() {
        let cases = [
            ("x: 1\n", 1, "stands in no section"),
            ("[a]\n\nwhat\n", 3, "neither a section nor an option"),
            ("[a\n", 1, "no closing"),
            ("[ ]\n", 1, "needs a name"),
            ("[a]\n: 5\n", 2, "no name before"),
            ("[a]\nk: 1\nk: 2\n", 3, "set twice"),
            ("[a] k: 1\n", 1, "after `]`"),
            ("#*# <--- SAVE_CONFIG --->\n#*# [a]\n[b]\n", 3, "after the SAVE_CONFIG block"),
        ];
        for (text, line, words) in cases {
            let mut log = Log::default();
            read(text, &mut log);
            let diagnostics = log.into_diagnostics();
            assert_eq!(diagnostics.len(), 1, "{text:?}: {diagnostics:?}");
            assert_eq!(diagnostics[0].line, line, "{text:?}");
            assert!(diagnostics[0].message.contains(words), "{text:?}: {}", diagnostics[0].message);
        }
    }

    #[test]
    fn a_file_that_is_too_long_is_refused_unread() {
        let mut log = Log::default();
        let document = read(&"[a]\n".repeat(CONFIG_BYTES_MAX / 4 + 1), &mut log);
        assert!(document.sections.is_empty());
        assert!(log.has_errors());
    }
}
