//! The reasons for the choices of a bake, in words.

use crate::Choice;
use bvh_core::Frame;
use bvh_core::glam::DMat3;
use core::fmt;

/// A choice of a bake, and why. It is shown as one line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// The frame.
    Frame(Choice),
    /// Something that was tried, other things being equal.
    Tried {
        /// What it is.
        choice: Tried,
        /// Whether it was chosen.
        is_chosen: bool,
        /// The fraction of the expected tests of untrained rays that it saves; below 0 if it costs
        /// some.
        saved: f64,
    },
    /// The work.
    Work {
        /// The nodes to visit.
        work: u64,
        /// The nodes to visit per object.
        per_object: u64,
        /// What more would bring.
        more: More,
    },
}

/// What more work would bring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum More {
    /// It would hardly pay.
    HardlyPays,
    /// It would pay, but the scene is large.
    Pays,
    /// Little, because a short search saves only this fraction of the tests.
    Little(f64),
}

/// Something that a bake tries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tried {
    /// The cost of the wide layout instead of area.
    Layout,
    /// Rays from anywhere instead of random lines.
    Rays,
    /// Divided objects.
    References,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Frame(Choice { sufficed: false, .. }) => f.write_str(
                "frame: the budget is too small to try others; kept are the file's axes",
            ),
            // Triangles in f64 have a frame for its centre, too.
            Self::Frame(Choice { frame: Some(frame), gain, .. })
                if frame.rotation() != DMat3::IDENTITY =>
            {
                let degrees = angle(frame).to_degrees();
                let percent = 100.0 * gain;
                write!(
                    f,
                    "frame: turned by {degrees:.0} degrees, {percent:.0} % less area than along \
                     the file's axes"
                )
            }
            Self::Frame(_) => {
                f.write_str("frame: no other saves enough area; kept are the file's axes")
            }
            Self::Tried { choice, is_chosen, saved } => {
                let name = match choice {
                    Tried::Layout => "cost: the wide layout's",
                    Tried::Rays => "rays: default",
                    Tried::References => "references: 1.2 per object",
                };
                let verdict = if *is_chosen { "yes" } else { "no" };
                let percent = 100.0 * saved.abs();
                let direction = if *saved < 0.0 { "more" } else { "fewer" };
                write!(
                    f,
                    "{name}: {verdict}, {percent:.1} % {direction} expected tests of untrained rays"
                )
            }
            Self::Work { work, per_object, more } => {
                let millions = *work as f64 / 1e6;
                write!(f, "budget: {millions:.0} Mwork, {per_object} nodes per object; ")?;
                match more {
                    More::HardlyPays => f.write_str("more would hardly pay"),
                    More::Pays => f.write_str("because the scene is large; more would pay"),
                    More::Little(saved) => {
                        let percent = 100.0 * saved;
                        write!(
                            f,
                            "little is to be won, a short search saves {percent:.1} % of tests"
                        )
                    }
                }
            }
        }
    }
}

/// Returns the angle of the frame's rotation.
fn angle(frame: &Frame) -> f64 {
    let rotation = frame.rotation();
    let trace = rotation.x_axis.x + rotation.y_axis.y + rotation.z_axis.z;
    libm::acos((0.5 * (trace - 1.0)).clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::glam::DVec3;

    #[test]
    fn reasons_are_lines() {
        let tried = |choice, is_chosen, saved| Reason::Tried { choice, is_chosen, saved };
        let frame = Frame::new(DMat3::from_rotation_y(0.5), DVec3::ZERO).ok();
        let turned = Choice { frame, gain: 0.25, agreeing: 0.5, sufficed: true };
        let frame = Frame::new(DMat3::IDENTITY, DVec3::ONE).ok();
        let centred = Choice { frame, gain: 0.0, ..turned };
        let more = More::Little(0.06);
        for (reason, beginning) in [
            (tried(Tried::Layout, true, 0.0512), "cost: the wide layout's: yes, 5.1 % fewer"),
            (tried(Tried::Rays, false, -0.02), "rays: default: no, 2.0 % more"),
            (tried(Tried::Rays, false, 0.0), "rays: default: no, 0.0 % fewer"),
            (
                Reason::Work { work: 12_600_000, per_object: 800, more },
                "budget: 13 Mwork, 800 nodes",
            ),
            (Reason::Frame(turned), "frame: turned by 29 degrees, 25 % less area"),
            (Reason::Frame(centred), "frame: no other saves enough area"),
        ] {
            let line = reason.to_string();
            assert!(line.starts_with(beginning) && !line.contains('\n'), "{line}");
        }
    }
}
