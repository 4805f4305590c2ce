//! The examples in the documentation, and its commands that call a program.

use crate::support::{pages, run};
use std::fs;
use std::path::{Path, PathBuf};

/// A block of code on a page.
pub struct Block {
    pub page: PathBuf,
    /// The number of the block's first line, counted from 1.
    pub line: usize,
    pub language: String,
    pub text: String,
}

impl Block {
    pub fn place(&self) -> String {
        format!("{}:{}", self.page.display(), self.line)
    }
}

/// Lists the pages without the changelog, whose old commands may be invalid today.
fn pages_of_today() -> impl Iterator<Item = PathBuf> {
    pages().into_iter().filter(|page| !page.ends_with("CHANGELOG.md"))
}

/// Returns the blocks of all pages without the changelog.
pub fn blocks() -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    for page in pages_of_today() {
        let mut is_open = false;
        let text = fs::read_to_string(&page).unwrap();
        for (number, line) in text.lines().enumerate() {
            match line.strip_prefix("```") {
                Some(_) if is_open => is_open = false,
                Some(language) => {
                    let page = page.clone();
                    let language = language.to_owned();
                    blocks.push(Block { page, line: number + 2, language, text: String::new() });
                    is_open = true;
                }
                None if is_open => blocks.last_mut().unwrap().text += &format!("{line}\n"),
                None => {}
            }
        }
        assert!(!is_open, "{} ends in a block", page.display());
    }
    blocks
}

/// Returns the blocks in a language, at least one.
pub fn blocks_in(language: &str) -> Vec<Block> {
    let mut blocks = blocks();
    blocks.retain(|block| block.language.split(',').next() == Some(language));
    assert!(!blocks.is_empty(), "no block of {language}");
    blocks
}

/// Splits shell text into the words of its commands, without comments, leading variables, and the
/// parts after a pipe.
pub fn commands(text: &str, place: &str) -> Vec<Vec<String>> {
    let mut commands = Vec::new();
    for line in text.replace("\\\n", " ").lines() {
        let words = shlex::split(line).unwrap_or_else(|| panic!("{place}: `{line}` is no shell"));
        let command: Vec<String> = words
            .into_iter()
            // Names of variables are upper case, and those of programs are not.
            .skip_while(|word| word.starts_with(char::is_uppercase))
            .take_while(|word| word != "|")
            .collect();
        if !command.is_empty() {
            commands.push(command);
        }
    }
    commands
}

/// Asserts that a program accepts the flags and values of all its commands on the pages, in blocks
/// and in sentences. Returns the number of commands.
pub fn accepts_printed_commands(name: &str, package: &str) -> usize {
    let mut texts: Vec<(String, String)> =
        blocks_in("sh").into_iter().map(|block| (block.place(), block.text)).collect();
    for page in pages_of_today() {
        let text = fs::read_to_string(&page).unwrap();
        // Every second part is a block.
        let outside: String = text.split("```").step_by(2).collect();
        let inline_code = outside.split('`').skip(1).step_by(2);
        for code in inline_code.filter(|code| code.starts_with(&format!("{name} "))) {
            // A command may be wrapped like the sentence around it.
            texts.push((page.display().to_string(), code.replace('\n', " ")));
        }
    }
    let mut accepted = 0;
    for (place, text) in texts {
        for command in commands(&text, &place) {
            let Some(mut arguments) = arguments(&command, name, package) else { continue };
            // The program then reads the other arguments and does nothing.
            arguments.push("--help");
            let answer = run(Path::new("."), &arguments);
            let message = crate::support::text(&answer.stderr);
            assert_eq!(answer.status.code(), Some(0), "{place}: {command:?}: {message}");
            accepted += 1;
        }
    }
    accepted
}

/// Returns a program's arguments in a command, if the command calls the program.
fn arguments<'a>(command: &'a [String], name: &str, package: &str) -> Option<Vec<&'a str>> {
    let words: Vec<&str> = command.iter().map(String::as_str).collect();
    let end = words.iter().position(|&word| word == "--");
    match (&words[..], end) {
        ([program, ..], _) if *program == name => Some(words[1..].to_vec()),
        (["cargo", "run", ..], Some(end)) => {
            let is_called = words[..end].windows(2).any(|pair| pair == ["-p", package]);
            is_called.then(|| words[end + 1..].to_vec())
        }
        _ => None,
    }
}
