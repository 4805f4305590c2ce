//! The examples in the documentation, and its commands that call a program.

use crate::support::{program, run, text, top};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

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

/// Lists the paths of all pages except the changelog, whose old commands may be invalid today.
pub fn pages() -> Vec<PathBuf> {
    let mut pages = entries(".");
    pages.extend(entries("docs"));
    for folder in entries("crates") {
        pages.push(folder.join("README.md"));
    }
    pages.push(top().join("results/README.md"));
    pages.retain(|path| {
        let is_markdown = path.extension().is_some_and(|extension| extension == "md");
        is_markdown && path.is_file() && !path.ends_with("CHANGELOG.md")
    });
    pages.sort();
    pages
}

fn entries(folder: &str) -> Vec<PathBuf> {
    fs::read_dir(top().join(folder)).unwrap().map(|entry| entry.unwrap().path()).collect()
}

/// Returns the blocks of all pages.
pub fn blocks() -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    for page in pages() {
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
        // GNU parallel replaces braces by a number.
        let command: Vec<String> = words
            .iter()
            .skip_while(|word| is_variable(word))
            .take_while(|word| !["|", ":::"].contains(&word.as_str()))
            .map(|word| word.replace("{}", "1"))
            .collect();
        match command.first().map(String::as_str) {
            None => {}
            Some("parallel") => commands.push(command[1..].to_vec()),
            Some(_) => commands.push(command),
        }
    }
    commands
}

/// Returns whether a word sets a variable of the environment.
fn is_variable(word: &str) -> bool {
    let Some((name, _)) = word.split_once('=') else { return false };
    name.bytes().all(|byte| byte == b'_' || byte.is_ascii_uppercase())
}

/// The names of a program and of its package.
pub struct Called {
    pub name: &'static str,
    pub package: &'static str,
}

impl Called {
    /// Returns the program's arguments in a command, if the command calls the program.
    fn arguments<'a>(&self, command: &'a [String]) -> Option<Vec<&'a str>> {
        let words: Vec<&str> = command.iter().map(String::as_str).collect();
        let end = words.iter().position(|&word| word == "--");
        match (&words[..], end) {
            ([name, ..], _) if *name == self.name => Some(words[1..].to_vec()),
            (["cargo", "run", ..], Some(end)) => {
                let is_called = words[..end].windows(2).any(|pair| pair == ["-p", self.package]);
                is_called.then(|| words[end + 1..].to_vec())
            }
            _ => None,
        }
    }

    /// Asserts that the program accepts the arguments of all commands in blocks. Returns the number
    /// of commands.
    pub fn reads_blocks(&self) -> usize {
        // In an empty folder valid commands end soon, because the files that they name do not
        // exist.
        let empty = tempfile::tempdir().unwrap();
        let mut read = 0;
        for block in blocks_in("sh") {
            for command in commands(&block.text, &block.place()) {
                let Some(arguments) = self.arguments(&command) else { continue };
                let answer = beginning(empty.path(), &arguments);
                assert!(!answer.contains(UNREADABLE), "{}: {command:?}: {answer}", block.place());
                read += 1;
            }
        }
        read
    }

    /// Asserts that the program has the commands and flags that sentences name. Returns the number
    /// of commands.
    pub fn knows_sentences(&self) -> usize {
        let mut read = 0;
        for page in pages() {
            let text = fs::read_to_string(&page).unwrap();
            // Every second part is a block.
            let outside: String = text.split("```").step_by(2).collect();
            let place = page.display().to_string();
            let begins = format!("{} ", self.name);
            let inline_code = outside.split('`').skip(1).step_by(2);
            for code in inline_code.filter(|code| code.starts_with(&begins)) {
                // A command may be wrapped like the sentence around it.
                for command in commands(&code.replace('\n', " "), &place) {
                    let Some(mut arguments) = self.arguments(&command) else { continue };
                    arguments.push("--help");
                    let answer = run(Path::new("."), &arguments);
                    let message = crate::support::text(&answer.stderr);
                    assert_eq!(answer.status.code(), Some(0), "{place}: `{code}`: {message}");
                    read += 1;
                }
            }
        }
        read
    }
}

/// The part of a program's message about invalid arguments.
pub const UNREADABLE: &str = "try '--help'";

/// Returns the messages of a command on standard error within two seconds.
fn beginning(folder: &Path, arguments: &[&str]) -> String {
    let mut child =
        program(folder, arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() && start.elapsed() < Duration::from_secs(2) {
        std::thread::sleep(Duration::from_millis(5));
    }
    let _ = child.kill();
    text(&child.wait_with_output().unwrap().stderr)
}
