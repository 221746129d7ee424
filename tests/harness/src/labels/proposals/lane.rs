//! A lane, and where a place is beside it.

/// The middle of a lane, in the direction of travel.
#[derive(Debug, Clone, Default)]
pub struct Lane {
    pub(super) points: Vec<[f64; 2]>,
    /// Of a straight lane the place it is known best at, and how well.
    pub(super) straight: Option<([f64; 2], f64)>,
}

/// A place beside a lane.
#[derive(Debug, Clone, Copy)]
pub struct Beside {
    /// Along the lane from its start, metres.
    pub along_m: f64,
    /// Left of its middle, metres.
    pub left_m: f64,
    /// Unit vector of the direction of travel there.
    pub heading: [f64; 2],
}

impl Lane {
    /// The place so far along this lane, and the direction there; `None` beyond its end.
    pub fn at(&self, along_m: f64) -> Option<([f64; 2], [f64; 2])> {
        let mut rest = along_m;
        for pair in self.points.windows(2) {
            let [dx, dy] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let length = dx.hypot(dy);
            if rest <= length && length > 1e-6 {
                return Some((
                    [pair[0][0] + dx * rest / length, pair[0][1] + dy * rest / length],
                    [dx / length, dy / length],
                ));
            }
            rest -= length;
        }
        None
    }

    /// Where a place is beside this lane; `None` before its start and after its end.
    pub fn beside(&self, place: [f64; 2]) -> Option<Beside> {
        let mut best: Option<(f64, Beside)> = None;
        let mut begin_m = 0.0;
        for pair in self.points.windows(2) {
            let [dx, dy] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let length = dx.hypot(dy);
            if length < 1e-6 {
                continue;
            }
            let [c, s] = [dx / length, dy / length];
            let [px, py] = [place[0] - pair[0][0], place[1] - pair[0][1]];
            let (along, left) = (px * c + py * s, -px * s + py * c);
            // bends leave gaps of a little more than a half between the segments
            if (-0.5..=length + 0.5).contains(&along) && best.as_ref().is_none_or(|(d, _)| left.abs() < *d) {
                let beside = Beside { along_m: begin_m + along, left_m: left, heading: [c, s] };
                best = Some((left.abs(), beside));
            }
            begin_m += length;
        }
        best.map(|(_, beside)| beside)
    }
}

/// The lane of this direction a place lies on, by its number: the nearest.
pub fn nearest(lanes: &[Lane], place: [f64; 2], direction: Option<[f64; 2]>, within_m: f64) -> Option<(usize, Beside)> {
    let all = lanes.iter().enumerate().filter_map(|(k, lane)| Some((k, lane.beside(place)?)));
    let fits = |b: &Beside| direction.is_none_or(|[x, y]| b.heading[0] * x + b.heading[1] * y > 0.0);
    all.filter(|(_, b)| b.left_m.abs() <= within_m && fits(b))
        .min_by(|a, b| a.1.left_m.abs().total_cmp(&b.1.left_m.abs()))
}
