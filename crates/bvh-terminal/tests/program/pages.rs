//! The examples in the documentation, and the commands in it that call a program.

use super::support::{program, run, text, top};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

/// A block of code on a page.
pub struct Block {
    pub page: PathBuf,
    /// The number of its first line, from 1.
    pub line: usize,
    pub language: String,
    pub text: String,
}

impl Block {
    pub fn place(&self) -> String {
        format!("{}:{}", self.page.display(), self.line)
    }
}

/// The paths, within the project, of all pages but the changelog, which speaks of what was.
pub fn pages() -> Vec<PathBuf> {
    let below = |folder: &str| {
        fs::read_dir(top().join(folder))
            .unwrap()
            .map(|entry| entry.unwrap().path())
    };
    let readmes = below("crates").map(|folder| folder.join("README.md"));
    let pages = below(".")
        .chain(below("docs"))
        .chain(readmes)
        .chain([top().join("results/README.md")]);
    let is_page = |path: &PathBuf| {
        path.extension()
            .is_some_and(|extension| extension == "md")
            && path.is_file()
    };
    let mut pages: Vec<PathBuf> = pages
        .filter(is_page)
        .filter(|path| !path.ends_with("CHANGELOG.md"))
        .collect();
    pages.sort();
    pages
}

/// The blocks of all pages.
pub fn blocks() -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    for page in pages() {
        let mut is_open = false;
        for (number, line) in fs::read_to_string(&page)
            .unwrap()
            .lines()
            .enumerate()
        {
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

/// The blocks in a language; at least one.
pub fn blocks_in(language: &str) -> Vec<Block> {
    let mut blocks = blocks();
    blocks.retain(|block| block.language.split(',').next() == Some(language));
    assert!(!blocks.is_empty(), "no block of {language}");
    blocks
}

/// The commands of a shell's text, word by word: without comments, and what is behind a pipe or before the variables' ends.
pub fn commands(text: &str, place: &str) -> Vec<Vec<String>> {
    let mut commands = Vec::new();
    for line in text.replace("\\\n", " ").lines() {
        let words = shlex::split(line).unwrap_or_else(|| panic!("{place}: `{line}` is no shell"));
        let is_variable = |word: &String| {
            word.split_once('=').is_some_and(|(name, _)| {
                name.bytes()
                    .all(|byte| byte == b'_' || byte.is_ascii_uppercase())
            })
        };
        let command = words
            .into_iter()
            .skip_while(is_variable)
            .take_while(|word| !["|", ":::"].contains(&word.as_str()));
        // GNU parallel puts a number in the place of braces.
        let command: Vec<String> = command
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

/// A program by its name and by that of its package.
pub struct Called {
    pub name: &'static str,
    pub package: &'static str,
}

impl Called {
    /// The program's arguments in a command, if it calls the program.
    fn arguments<'a>(&self, command: &'a [String]) -> Option<Vec<&'a str>> {
        let words: Vec<&str> = command.iter().map(String::as_str).collect();
        let end = words.iter().position(|&word| word == "--");
        match (&words[..], end) {
            ([name, ..], _) if *name == self.name => Some(words[1..].to_vec()),
            (["cargo", "run", ..], Some(end)) => {
                let is_called = words[..end]
                    .windows(2)
                    .any(|pair| pair == ["-p", self.package]);
                is_called.then(|| words[end + 1..].to_vec())
            }
            _ => None,
        }
    }

    /// Asserts that the program reads the arguments of all commands in blocks. Returns how many there are.
    pub fn reads_blocks(&self) -> usize {
        // An empty folder, so that whatever can be read ends soon: nothing that is named is there.
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

    /// Asserts that the program has the commands and flags that sentences name. Returns how many commands there are.
    pub fn knows_sentences(&self) -> usize {
        let mut read = 0;
        for page in pages() {
            let text = fs::read_to_string(&page).unwrap();
            let outside: String = text.split("```").step_by(2).collect();
            let place = page.display().to_string();
            let begins = format!("{} ", self.name);
            for code in outside
                .split('`')
                .skip(1)
                .step_by(2)
                .filter(|code| code.starts_with(&begins))
            {
                for command in commands(code, &place) {
                    let Some(mut arguments) = self.arguments(&command) else { continue };
                    arguments.push("--help");
                    let answer = run(Path::new("."), &arguments);
                    let said = super::support::text(&answer.stderr);
                    assert_eq!(answer.status.code(), Some(0), "{place}: `{code}`: {said}");
                    read += 1;
                }
            }
        }
        read
    }
}

/// How a program begins to answer what it cannot read.
pub const UNREADABLE: &str = "try '--help'";

/// What a command says on standard error within two seconds.
fn beginning(folder: &Path, arguments: &[&str]) -> String {
    let mut child = program(folder, arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() && start.elapsed() < Duration::from_secs(2) {
        std::thread::sleep(Duration::from_millis(5));
    }
    let _ = child.kill();
    text(&child.wait_with_output().unwrap().stderr)
}
