//! Finds places for labels inside a panel where they cover neither data nor each other.

use std::collections::BTreeSet;

use super::canvas::Frame;

/// Distance at which obstacles are remembered, in pixels.
const GRAIN: f64 = 4.0;

/// What a panel's labels must not cover.
pub(super) struct Labels {
    frame: Frame,
    obstacles: BTreeSet<(i32, i32)>,
    taken: Vec<Frame>,
}

fn cell((x, y): (f64, f64)) -> (i32, i32) {
    ((x / GRAIN).floor() as i32, (y / GRAIN).floor() as i32)
}

impl Labels {
    /// No label yet, and nothing in the way.
    pub fn new(frame: Frame) -> Self {
        Self { frame, obstacles: BTreeSet::new(), taken: Vec::new() }
    }

    /// Keeps labels off a line, as far as it runs inside the panel.
    pub fn avoid(&mut self, path: &[(f64, f64)]) {
        let near = |(x, y): (f64, f64)| {
            (
                x.clamp(self.frame.left - GRAIN, self.frame.right() + GRAIN),
                y.clamp(self.frame.top - GRAIN, self.frame.bottom() + GRAIN),
            )
        };
        let ends = path.iter().zip(path.iter().skip(1).chain(path.last()));
        for (from, to) in ends.map(|(&from, &to)| (near(from), near(to))) {
            let parts = ((to.0 - from.0).abs().max((to.1 - from.1).abs()) / GRAIN).ceil().max(1.0);
            for part in 0..=parts as i32 {
                let along = f64::from(part) / parts;
                self.obstacles
                    .insert(cell((from.0 + (to.0 - from.0) * along, from.1 + (to.1 - from.1) * along)));
            }
        }
    }

    /// Keeps labels off an area, as far as it is inside the panel.
    pub fn avoid_area(&mut self, area: Frame) {
        let mut y = area.top.max(self.frame.top);
        while y < area.bottom().min(self.frame.bottom()) {
            self.avoid(&[(area.left, y), (area.right(), y)]);
            y += GRAIN;
        }
        self.avoid(&[(area.left, area.bottom()), (area.right(), area.bottom())]);
    }

    /// The candidate that covers least, the first among equals.
    pub fn best(&mut self, candidates: &[Frame]) -> Option<Frame> {
        let cost = |place: &Frame| {
            let (from, to) = (cell((place.left, place.top)), cell((place.right(), place.bottom())));
            let rows = (from.0..=to.0).flat_map(|x| (from.1..=to.1).map(move |y| (x, y)));
            let covered = rows.filter(|cell| self.obstacles.contains(cell)).count();
            let clashes = self.taken.iter().filter(|taken| taken.overlaps(*place)).count();
            let outside = !self.frame.contains((place.left, place.top))
                || !self.frame.contains((place.right(), place.bottom()));
            covered + 1_000 * clashes + 100_000 * usize::from(outside)
        };
        let place = candidates.iter().copied().min_by_key(cost)?;
        self.taken.push(place);
        Some(place)
    }
}

/// Places of this size around a point, the nearest and most usual first.
pub(super) fn around((x, y): (f64, f64), width: f64, height: f64) -> Vec<Frame> {
    let mut places = Vec::new();
    for gap in [7.0, 16.0, 28.0, 44.0] {
        let slant = 0.7 * gap;
        let (left, right) = (x - gap - width, x + gap);
        let (above, below) = (y - gap - height, y + gap);
        let middle = y - height / 2.0;
        let corners = [
            (right, middle),
            (left, middle),
            (x - width / 2.0, above),
            (x - width / 2.0, below),
            (x + slant, y - slant - height),
            (x + slant, y + slant),
            (x - slant - width, y - slant - height),
            (x - slant - width, y + slant),
        ];
        places.extend(corners.map(|(left, top)| Frame { left, top, width, height }));
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    const PANEL: Frame = Frame { left: 0.0, top: 0.0, width: 200.0, height: 100.0 };

    #[test]
    fn a_label_stays_off_lines_and_other_labels() {
        let mut labels = Labels::new(PANEL);
        labels.avoid(&[(100.0, 50.0), (200.0, 50.0)]);
        let places = around((100.0, 50.0), 40.0, 14.0);
        let first = labels.best(&places).unwrap();
        assert!(first.right() < 100.0, "{first:?} lies on the line");
        let second = labels.best(&places).unwrap();
        assert!(!second.overlaps(first));
    }

    #[test]
    fn a_label_at_the_edge_is_put_inside() {
        let place = Labels::new(PANEL).best(&around((199.0, 1.0), 40.0, 14.0)).unwrap();
        assert!(PANEL.contains((place.left, place.top)) && PANEL.contains((place.right(), place.bottom())));
    }
}
