//! Writes to the terminal, and the contents of files: tables and pictures.

use crate::Error;
use bvh_scenes::files::{self, WriteError};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::Duration;

/// True if standard output has lost something.
static LOST: AtomicBool = AtomicBool::new(false);

/// Prints text to standard output, and ends the line. If that fails, the command goes on, because
/// its results are in files, and [`succeeded`] tells it at the end. A reader that closes the pipe
/// early, like `head`, causes no failure.
pub fn print_line(text: &str) {
    print_bytes(format!("{}\n", plain(text.trim_end())).as_bytes());
}

/// Prints the contents of a generated file for another program, with the errors of [`print_line`].
pub fn print_bytes(bytes: &[u8]) {
    let mut out = std::io::stdout();
    let written = out.write_all(bytes).and_then(|()| out.flush());
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
        && !LOST.swap(true, Relaxed)
    {
        print_error(&format!("error: the output could not be written to standard output: {error}"));
    }
}

/// Returns the exit code of a command that has succeeded, a failure if its output was lost.
pub fn succeeded() -> ExitCode {
    if LOST.load(Relaxed) { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

pub fn print_error(line: &str) {
    // Without standard error there is no place to report the failure.
    let _ = writeln!(std::io::stderr(), "{}", plain(line));
}

/// Returns a bar of this length, which is hidden unless standard error is a terminal.
pub fn bar(length: u64, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template);
    ProgressBar::new(length).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// The progress of a command: a bar, or without a terminal a line every ten seconds.
pub struct Progress {
    bar: ProgressBar,
    unit: &'static str,
    lines: Lines,
}

impl Progress {
    /// Begins to count up to this number of units.
    pub fn new(length: u64, unit: &'static str) -> Self {
        let template = format!("{{wide_bar}} {{pos}}/{{len}} {unit}, {{eta}} left");
        Self { bar: bar(length, &template), unit, lines: Lines::default() }
    }

    pub fn add(&self, count: u64) {
        let Self { bar, unit, lines } = self;
        bar.inc(count);
        if bar.is_hidden() && lines.is_due(bar.elapsed()) {
            let [done, all] = [bar.position(), bar.length().unwrap_or(0)];
            print_error(&format!("{done} of {all} {unit} after {} s", bar.elapsed().as_secs()));
        }
    }

    pub fn end(&self) {
        self.bar.finish_and_clear();
    }
}

/// The time of the last line, in tens of seconds since the beginning.
#[derive(Default)]
pub struct Lines(AtomicU64);

impl Lines {
    /// Returns whether this caller, of all threads, must show the next line.
    pub fn is_due(&self, elapsed: Duration) -> bool {
        let now = elapsed.as_secs() / 10;
        self.0.load(Relaxed) < now && self.0.fetch_max(now, Relaxed) < now
    }
}

/// Prints the parser's answer to the arguments: help, version, or their fault. Returns the exit
/// code.
pub fn answered(answer: &clap::Error) -> ExitCode {
    const USAGE: u8 = 2;
    let text = answer.render().to_string();
    // Help and version are results and go to standard output.
    if answer.use_stderr() {
        print_error(text.trim_end());
        return ExitCode::from(USAGE);
    }
    print_bytes(text.as_bytes());
    succeeded()
}

pub fn write_table<R: Serialize>(
    path: &Path,
    columns: &str,
    rows: impl Iterator<Item = R>,
) -> Result<(), Error> {
    let failed = |error: csv::Error| WriteError::of(path, "write the table")(error.into());
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(columns.split(',')).map_err(failed)?;
    for row in rows {
        writer.serialize(row).map_err(failed)?;
    }
    let table = writer.into_inner().map_err(|error| failed(error.into_error().into()))?;
    Ok(files::write(path, &table)?)
}

/// Encodes pixels, row by row from the top, as a PNG file with the highest compression.
pub fn png(width: u32, pixels: &[[u8; 3]]) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, pixels.len() as u32 / width);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::Adaptive);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels.as_flattened())?;
    writer.finish()?;
    Ok(bytes)
}

/// Escapes control characters except ends of lines. Names of files and keys of specs come from the
/// user and must not control the terminal.
fn plain(text: &str) -> String {
    let mut plain = String::new();
    for c in text.chars() {
        if c.is_control() && c != '\n' {
            plain.extend(c.escape_default());
        } else {
            plain.push(c);
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    #[test]
    fn decoded_pixels_equal_the_encoded_ones() {
        let pixels = [[1, 2, 3], [255, 0, 128], [9, 9, 9], [0, 0, 0], [7, 70, 250], [4, 5, 6]];
        let bytes = super::png(3, &pixels).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut read = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut read).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (3, 2, png::ColorType::Rgb));
        assert_eq!(read, pixels.as_flattened());
    }
}
