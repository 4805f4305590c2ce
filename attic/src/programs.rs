//! Embree and tinybvh, which need a C++ compiler: a separate program traces with them, behind
//! pipes.
//!
//! `scripts/ray-peers/build` makes the program; its source describes the bytes in the pipes. One
//! process per mode holds the scene as long as the contender lives, which lets all contenders
//! alternate in one run.

use crate::tracing::contender::{Batch, Contender, PART, Tracer};
use bvh_core::{Hit, Triangle};
use bvh_scenes::trace::Query;
use std::cell::RefCell;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A mode that the program lists.
#[derive(Debug, PartialEq, Eq)]
struct Mode {
    instructions: String,
    library: String,
    version: String,
    name: String,
}

impl Mode {
    /// Parses a line of four parts separated by tabs.
    fn parse(line: &str) -> Option<Self> {
        let parts: Vec<String> = line.split('\t').map(str::to_owned).collect();
        let [instructions, library, version, name] = parts.try_into().ok()?;
        Some(Self { instructions, library, version, name })
    }
}

/// Returns the modes that the program lists.
fn modes(program: &Path) -> Result<Vec<Mode>, String> {
    let shown = program.display();
    let listed = Command::new(program).output().map_err(|error| format!("{shown}: {error}"))?;
    let text = String::from_utf8_lossy(&listed.stdout);
    let mut modes = Vec::new();
    for line in text.lines() {
        modes.push(Mode::parse(line).ok_or_else(|| {
            format!(
                "{shown}: it lists {line:?}; expected instruction set, library, version and mode \
                 between tabs (scripts/ray-peers/build makes it again)"
            )
        })?);
    }
    // A program without modes would silently leave its library out of the comparison.
    if modes.is_empty() {
        return Err(format!("{shown}: it lists no mode; expected one per line"));
    }
    Ok(modes)
}

/// Starts a contender for every mode of the program. Returns each with the name of its library.
///
/// # Errors
///
/// If the program cannot be started or its output is malformed.
pub fn contenders(
    program: &Path,
    triangles: &[Triangle],
) -> Result<Vec<(String, Contender<'static>)>, String> {
    let mut contenders = Vec::new();
    for mode in modes(program)? {
        let argument = format!("{} {}", mode.library, mode.name);
        let command = format!("{} \"{argument}\"", program.display());
        let started = Process::start(program, &argument, triangles);
        let (process, preparation_seconds) =
            started.map_err(|error| format!("{command}: {error}"))?;
        // Contenders trace one after the other on one thread, so no lock is needed.
        let process = RefCell::new(process);
        let trace = move |batch: &Batch, hits: &mut [Option<Hit>]| {
            process.borrow_mut().trace(batch, hits).map_err(|error| format!("{command}: {error}"))
        };
        let contender = Contender {
            layout: mode.name,
            instructions: mode.instructions,
            version: mode.version,
            preparation_seconds,
            tracer: Tracer::Other(Box::new(trace)),
        };
        contenders.push((mode.library, contender));
    }
    Ok(contenders)
}

/// The program in one mode, with one scene.
struct Process {
    child: Child,
    /// `None` once the process is ending.
    rays: Option<BufWriter<ChildStdin>>,
    answers: BufReader<ChildStdout>,
}

impl Process {
    /// Starts the program and sends it the triangles. Also returns the seconds of its build.
    fn start(program: &Path, mode: &str, triangles: &[Triangle]) -> io::Result<(Self, f64)> {
        let mut child =
            Command::new(program).arg(mode).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let (Some(rays), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(io::Error::other("the program has no pipes"));
        };
        let mut rays = BufWriter::new(rays);
        let mut answers = BufReader::new(answers);
        rays.write_all(&(triangles.len() as u32).to_le_bytes())?;
        rays.write_all(bytemuck::cast_slice(triangles))?;
        // The program answers only after it has read everything, so unsent bytes would block both.
        rays.flush()?;
        let mut seconds = [0f64];
        answers.read_exact(bytemuck::cast_slice_mut(&mut seconds))?;
        Ok((Self { child, rays: Some(rays), answers }, seconds[0]))
    }

    fn trace(&mut self, batch: &Batch, hits: &mut [Option<Hit>]) -> io::Result<Vec<f64>> {
        let Some(rays) = &mut self.rays else { return Err(io::ErrorKind::BrokenPipe.into()) };
        ask(rays, batch)?;
        answer(&mut self.answers, hits)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // The program ends when its input ends.
        self.rays = None;
        _ = self.child.wait();
    }
}

/// Writes a query and its rays.
fn ask(program: &mut impl Write, batch: &Batch) -> io::Result<()> {
    let any = u32::from(batch.query == Query::Any);
    let picture = u32::from(batch.in_squares);
    for number in [any, picture, batch.rays.len() as u32, PART as u32] {
        program.write_all(&number.to_le_bytes())?;
    }
    for ray in batch.rays {
        let [x, y, z] = ray.origin().to_array();
        let [dx, dy, dz] = ray.direction().to_array();
        for number in [x, y, z, ray.t_min(), dx, dy, dz, ray.t_max()] {
            program.write_all(&number.to_le_bytes())?;
        }
    }
    program.flush()
}

/// Reads the seconds of each part and the hits of all rays. A hit has a distance but no object.
fn answer(program: &mut impl Read, hits: &mut [Option<Hit>]) -> io::Result<Vec<f64>> {
    let mut seconds = vec![0f64; hits.len().div_ceil(PART)];
    let mut distances = vec![0f32; hits.len()];
    program.read_exact(bytemuck::cast_slice_mut(&mut seconds))?;
    program.read_exact(bytemuck::cast_slice_mut(&mut distances))?;
    for (hit, t) in hits.iter_mut().zip(distances) {
        *hit = t.is_finite().then_some(Hit { t, object: 0 });
    }
    Ok(seconds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::{Coherence, Ray};

    #[test]
    fn a_line_of_the_list_of_modes_has_four_parts() {
        let mode = Mode::parse("AVX2\tembree\t4.4.0\thigh robust, coherent packets").unwrap();
        assert_eq!(
            (mode.library.as_str(), mode.name.as_str()),
            ("embree", "high robust, coherent packets")
        );
        assert_eq!((mode.instructions.as_str(), mode.version.as_str()), ("AVX2", "4.4.0"));
        assert_eq!(Mode::parse("embree high"), None);
        assert_eq!(Mode::parse("AVX2\tembree\t4.4.0\thigh\tmore"), None);
    }

    #[test]
    fn rays_go_out_as_described_and_answers_come_back_in_their_order() {
        let rays = [Ray::new([1.0, 2.0, 3.0], [0.0, 0.0, -1.0], 0.0, 7.0).unwrap(); 3];
        let mut sent = Vec::new();
        let batch = Batch {
            query: Query::Any,
            coherence: Coherence::Coherent,
            in_squares: true,
            rays: &rays,
        };
        ask(&mut sent, &batch).unwrap();
        assert_eq!(sent.len(), 4 * 4 + 3 * 8 * 4);
        let words = sent.as_chunks::<4>().0;
        let counts: Vec<u32> = words[..4].iter().map(|word| u32::from_le_bytes(*word)).collect();
        assert_eq!(counts, [1, 1, 3, PART as u32]);
        let ray: Vec<f32> = words[4..12].iter().map(|word| f32::from_le_bytes(*word)).collect();
        assert_eq!(ray, [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, -1.0, 7.0]);

        let mut received = 0.25f64.to_le_bytes().to_vec();
        received.extend([2.5, f32::INFINITY, 0.0].map(f32::to_le_bytes).as_flattened());
        let mut hits = [None; 3];
        assert_eq!(answer(&mut &received[..], &mut hits).unwrap(), [0.25]);
        let hit = |t| Some(Hit { t, object: 0 });
        assert_eq!(hits, [hit(2.5), None, hit(0.0)]);
        assert!(answer(&mut &received[1..], &mut hits).is_err(), "an answer that is cut short");
    }

    #[test]
    fn a_missing_program_is_named() {
        let Err(message) = contenders(Path::new("no/ray_peers"), &[]) else { panic!("it ran") };
        assert!(message.contains("no/ray_peers"), "{message}");
    }
}
