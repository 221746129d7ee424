//! Moving obstacles: detections that move together, followed from frame to frame.

mod fixtures;
mod obstacle;
mod off_axis;
mod outline;
mod rules;
mod synthetic;

use viewshed_harness::geometry::solid::Solid;

use crate::geometry::{Ground, Placed};
pub use obstacle::Obstacle;
pub use rules::Rules;

/// How far behind the sensor an obstacle is followed, metres.
const BEHIND: f64 = -20.0;
/// Stretches of distance that detections are visited in, nearest first, when a vehicle is gathered.
const STRETCHES: f64 = 64.0;

#[derive(Debug, Clone, Default)]
pub struct Obstacles {
    pub list: Vec<Obstacle>,
    fixtures: Vec<fixtures::Fixture>,
    turn: usize,
    /// Most obstacles followed.
    pub capacity: usize,
}

impl Obstacles {
    pub fn new(capacity: usize) -> Self {
        Self { capacity, ..Self::default() }
    }

    /// Boxes of those that are confirmed, at least two frames old, and have moved.
    pub fn solids<'a>(&'a self, rules: &'a Rules) -> impl Iterator<Item = Solid> + 'a {
        let stands = |o: &&Obstacle| o.existence >= rules.confirm_hits && o.age >= 2 && o.is_mover(rules);
        self.list.iter().filter(stands).map(|o| o.solid(rules))
    }

    /// Takes one frame's detections; returns for each whether it belongs to an obstacle. `in_view` says
    /// whether a place is in plain view.
    pub fn step(&mut self, placed: &[Placed], dt: f64, rules: &Rules, in_view: impl Fn(Ground) -> bool) -> Vec<bool> {
        self.list.iter_mut().for_each(|o| o.predict(dt, rules));
        let of_fixtures = self.of_fixtures(placed, rules);
        let mut claimed = self.associate(placed, &of_fixtures, dt, rules);
        self.list.iter_mut().for_each(|o| o.settle(dt, rules));
        self.found(placed, &of_fixtures, &mut claimed, rules);
        self.learn_fixtures(placed, &claimed, dt, rules, &in_view);
        self.join_parts(rules);
        let farther: Vec<bool> = self.list.iter().map(|o| o.is_farther_end(&self.list, rules)).collect();
        self.list.iter_mut().zip(farther).for_each(|(o, farther)| o.farther_end = farther);
        self.list.iter_mut().filter(|o| o.seen()).for_each(|o| o.look_for_end(rules, &in_view));
        self.doubt_the_unseen(dt, rules, in_view);
        claimed
    }

    /// Moves all on over a gap in the frames, in which nobody looked.
    pub fn bridge(&mut self, gap: f64, rules: &Rules) {
        self.list.retain(|o| o.existence >= rules.confirm_hits);
        let mut left = gap;
        for o in self.list.iter_mut().filter(|o| o.is_standing(rules)) {
            o.existence -= gap * rules.standing_hidden_loss;
        }
        while left > 0.0 {
            let dt = left.min(1.0);
            left -= dt;
            for o in self.list.iter_mut().filter(|o| !o.is_standing(rules)) {
                o.predict(dt, rules);
                o.existence -= dt * rules.hidden_loss;
            }
        }
        self.list.retain(|o| o.existence > 0.0);
    }

    /// Gives each detection to the obstacle it fits best; of equals, to the elder in the list.
    fn associate(&mut self, placed: &[Placed], of_fixtures: &[bool], dt: f64, rules: &Rules) -> Vec<bool> {
        let best = |d: &Placed| {
            let fits = self.list.iter().enumerate().filter_map(|(k, o)| o.misfit(d, rules).map(|m| (k, m)));
            fits.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
        };
        let owners: Vec<Option<usize>> =
            placed.iter().zip(of_fixtures).map(|(d, of_fixture)| if *of_fixture { None } else { best(d) }).collect();
        for (d, owner) in placed.iter().zip(&owners) {
            let Some(o) = owner.map(|k| &mut self.list[k]) else { continue };
            if !o.seen() {
                o.fade_outline(dt, rules);
            }
            o.absorb(d, rules);
        }
        let mut claimed: Vec<bool> = owners.iter().map(Option::is_some).collect();
        self.associate_wheels(placed, &mut claimed, rules);
        claimed
    }

    /// Gives what is left and moves to the vehicle whose wheel it may be.
    fn associate_wheels(&mut self, placed: &[Placed], claimed: &mut [bool], rules: &Rules) {
        let believed = |o: &&mut Obstacle| o.existence >= rules.confirm_hits;
        for (d, claimed) in placed.iter().zip(claimed).filter(|(d, c)| !**c && rules.course(d).is_some()) {
            let fits =
                self.list.iter_mut().filter(believed).filter_map(|o| o.misfit_of_wheel(d, rules).map(|m| (m, o)));
            if let Some((_, o)) = fits.min_by(|a, b| a.0.total_cmp(&b.0)) {
                o.absorb_wheel(d);
                *claimed = true;
            }
        }
    }

    /// Starts obstacles from detections that move along the road and belong to nobody; at most half as
    /// many in a frame as are followed at all.
    fn found(&mut self, placed: &[Placed], of_fixtures: &[bool], claimed: &mut [bool], rules: &Rules) {
        let stretch = |i: &usize| (placed[*i].ground() / (rules.limit / STRETCHES)) as usize;
        let mut nearest_first: Vec<usize> = (0..placed.len()).collect();
        nearest_first.sort_by_key(stretch);
        let mut born = 0;
        for (i, seed) in placed.iter().enumerate() {
            let Some((heading, speed)) = rules.course(seed).filter(|_| !claimed[i]) else { continue };
            if born == self.capacity / 2 {
                return;
            }
            born += 1;
            let mut newborn = Obstacle::new(seed, heading, speed);
            newborn.absorb(seed, rules);
            claimed[i] = true;
            for &j in &nearest_first {
                let d = &placed[j];
                if !claimed[j] && !of_fixtures[j] && newborn.misfit(d, rules).is_some() {
                    newborn.absorb(d, rules);
                    newborn.reach(d);
                    claimed[j] = true;
                }
            }
            newborn.settle(0.0, rules);
            self.admit(newborn, rules);
        }
    }

    /// Adds a newborn; to a full list in the place of the least believed in, if that is unconfirmed
    /// and less believed in than the newborn.
    fn admit(&mut self, newborn: Obstacle, rules: &Rules) {
        if self.list.len() < self.capacity {
            self.list.push(newborn);
            return;
        }
        let weakest = self.list.iter_mut().min_by(|a, b| a.existence.total_cmp(&b.existence));
        if let Some(o) = weakest.filter(|o| o.existence < rules.confirm_hits && o.existence < newborn.existence) {
            *o = newborn;
        }
    }

    /// Joins parts of one vehicle: the one with more detections takes the other, which is dropped. So is
    /// what lies within a vehicle, unless that moves unseen over one that is seen to stand.
    fn join_parts(&mut self, rules: &Rules) {
        for i in 0..self.list.len() {
            for j in i + 1..self.list.len() {
                let (a, b) = (&self.list[i], &self.list[j]);
                if a.existence <= 0.0 || b.existence <= 0.0 {
                    continue;
                }
                let (elder, younger) = if b.hits > a.hits { (j, i) } else { (i, j) };
                let other = self.list[younger].clone();
                let elder = &mut self.list[elder];
                if elder.is_one_with(&other, rules) {
                    elder.join(&other, rules);
                    self.list[younger].existence = 0.0;
                } else if elder.may_be_leaving_as(&other, rules) {
                    if other.existence >= rules.confirm_hits {
                        let before = std::mem::replace(elder, other);
                        elder.inherit(&before);
                        self.list[younger].existence = 0.0;
                    }
                } else if elder.takes_away(&other, rules) {
                    self.list[younger].existence = 0.0;
                }
            }
        }
    }

    /// Takes evidence from obstacles nobody saw, quickly where they should have been seen, and drops
    /// those without evidence, fixtures and those out of reach.
    fn doubt_the_unseen(&mut self, dt: f64, rules: &Rules, in_view: impl Fn(Ground) -> bool) {
        for o in self.list.iter_mut().filter(|o| !o.seen() && o.existence > 0.0) {
            let places = [o.extent.front, o.extent.middle(), o.extent.rear];
            let loss = if o.existence < rules.confirm_hits {
                rules.tentative_loss
            } else {
                match (o.is_standing(rules), places.iter().any(|by| in_view(o.ahead(*by)))) {
                    (false, true) => rules.visible_loss,
                    (false, false) => rules.hidden_loss,
                    (true, true) => rules.standing_visible_loss,
                    (true, false) => rules.standing_hidden_loss,
                }
            };
            o.existence -= loss * dt;
        }
        self.list.retain(|o| {
            let [x, y] = o.anchor;
            o.existence > 0.0
                && !o.is_fixture(rules)
                && !o.is_a_mast(rules)
                && x > BEHIND
                && x < rules.limit
                && y.abs() < rules.limit
        });
    }
}
