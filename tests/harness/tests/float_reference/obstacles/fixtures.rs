//! Fixtures that are learnt: what reflects at the same place for long and is no vehicle.

use super::rules::Rules;
use super::{Obstacle, Obstacles};
use crate::geometry::{Ground, Placed, across, along, difference};

/// Fastest radial velocity of what does not move, m/s.
const STANDS: f64 = 0.5;
/// How far along the line of sight a fixture is seen from its place, and across it beside what noise allows for.
const ALONG: f64 = 0.6;
const ACROSS: f64 = 0.15;
/// Seconds it may stay away in plain view, and how much less hidden time counts.
const AWAY: f64 = 3.0;
const HIDDEN: f64 = 64.0;
/// One in so many candidates is compared with the obstacles in a frame.
const TURNS: usize = 8;
/// Most that a frame adds to times, seconds.
const MOST_PASSED: f64 = 1.0;
const MOST_NEW: usize = 4;
const FOLLOWS: f64 = 16.0;

#[derive(Debug, Clone, Copy)]
pub struct Fixture {
    place: Ground,
    /// Seconds; `None` for a fixture.
    known_for: Option<f64>,
    /// Seconds since it was compared with the obstacles.
    compared: f64,
    away: f64,
}

fn stands(d: &Placed) -> bool {
    d.radial_velocity.abs() <= STANDS
}

impl Fixture {
    /// Whether a detection lies within so many times the reach of what can be of it.
    fn reaches(&self, d: &Placed, times: f64, rules: &Rules) -> bool {
        let off = difference(d.at, self.place);
        let reach = ACROSS + rules.sigmas * d.sigma_across;
        let [forward, aside] = [along(d.sight, off).abs(), across(d.sight, off).abs()];
        stands(d) && forward <= times * ALONG && aside <= times * reach
    }
}

impl Obstacles {
    /// Which detections are of fixtures.
    pub fn of_fixtures(&self, placed: &[Placed], rules: &Rules) -> Vec<bool> {
        let known = |d: &Placed| self.fixtures.iter().any(|f| f.known_for.is_none() && f.reaches(d, 1.0, rules));
        placed.iter().map(known).collect()
    }

    /// Learns from detections that belong to no obstacle.
    pub fn learn_fixtures(
        &mut self,
        placed: &[Placed],
        claimed: &[bool],
        dt: f64,
        rules: &Rules,
        in_view: impl Fn(Ground) -> bool,
    ) {
        let dt = dt.min(MOST_PASSED);
        let first = if self.turn < self.fixtures.len() { self.turn } else { 0 };
        self.turn = first + self.fixtures.len().div_ceil(TURNS);
        let free: Vec<&Placed> =
            placed.iter().zip(claimed).filter(|(d, c)| !**c && stands(d)).map(|(d, _)| d).collect();
        let before = self.fixtures.clone();
        for (k, fixture) in self.fixtures.iter_mut().enumerate() {
            if let Some(d) = free.iter().find(|d| fixture.reaches(d, 1.0, rules)) {
                let [dx, dy] = difference(d.at, fixture.place);
                fixture.place = [fixture.place[0] + dx / FOLLOWS, fixture.place[1] + dy / FOLLOWS];
                fixture.away = 0.0;
            } else {
                let counts = fixture.known_for.is_some() || in_view(fixture.place);
                fixture.away += if counts { dt } else { dt / HIDDEN };
            }
            fixture.compared += dt;
            let its_turn = (first..self.turn).contains(&k);
            let Some(known_for) = fixture.known_for.filter(|_| its_turn) else { continue };
            let since = std::mem::take(&mut fixture.compared);
            if !self.list.iter().any(|o| o.may_have_a_part_at(fixture.place, rules)) {
                let known_for = known_for + since;
                fixture.known_for = Some(known_for).filter(|known_for| *known_for < rules.fixture_after);
            }
        }
        let stays = |fixture: &Fixture| fixture.away < AWAY;
        let gone = self.fixtures.iter().take(self.turn).filter(|fixture| !stays(fixture)).count();
        self.turn -= gone;
        self.fixtures.retain(stays);
        let new = free.into_iter().filter(|d| !before.iter().any(|f| f.reaches(d, 2.0, rules)));
        let mut last: Option<&Placed> = None;
        for d in new.take(if rules.fixture_after > 0.0 { MOST_NEW } else { 0 }) {
            let is_of_last = last.is_some_and(|last| {
                let [dx, dy] = difference(last.at, d.at);
                dx.abs() + dy.abs() < 2.0 * ALONG
            });
            if !is_of_last && self.fixtures.len() < self.capacity {
                self.fixtures.push(Fixture { place: d.at, known_for: Some(0.0), compared: 0.0, away: 0.0 });
            }
            last = Some(d);
        }
    }
}

impl Obstacle {
    /// Whether what reflects at a place may be a part of it that its outline lacks.
    fn may_have_a_part_at(&self, at: Ground, rules: &Rules) -> bool {
        let [forward, left] = self.local(at);
        let near = left.abs() < 2.0 && self.extent.beyond(forward) < 10.0;
        near && self.existence >= rules.confirm_hits && self.is_mover(rules)
    }
}
