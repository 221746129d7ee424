//! Moving obstacles: detections that move together, followed from frame to frame.
//!
//! A grid alone smears what moves 1.7 m a frame, and shows neither how long nor how high a thing
//! is. Doppler shows how each detection moves, so those of one vehicle can be gathered in its own
//! moving frame, where a second of them draws its outline. The outline's length gives the class,
//! the class the height, and the box casts its shadow on the map (`grid/shadow.rs`); cells of the grid stay as they are.
//!
//! # Limits
//! At most `N` obstacles. When the list is full, a new one replaces the one with the least evidence
//! if that is unconfirmed, and is dropped and counted otherwise.
//!
//! # What was tried
//! What today's rules are worth, each switched off alone, on scenes that are reported and with intervals, is in one table of
//! `tests/harness/src/evaluation/README.md` ("Rule by rule"). The tables here are the history: each has its own scenes, first second
//! and rules before it, so lines of one table can be compared with each other, and not with another table or with figures of today.
//! None has intervals; differences below a point are not told from chance, and few rules were tried again later.
//!
//! This first table can tell what turned the whole map on two crossings and two queues; it cannot tell small effects, as two scenes of a kind are few.
//! Cells FVR / FIR in percent on training scenes of the twin, two crossings and two queues, from their 20th
//! second on, and on the motorway recording; each line on top of those above that were kept. Synthetic data.
//! Lines below "middle of what is seen shown" were measured with it. Without it, and counted from the 30th
//! second on, `viewshed experiment --scene crossing --train` printed 23.4 / 13.6 with the rules of this table, `--scene queue --train`
//! 19.5 / 11.4, and `viewshed replay` of the motorway 17.6 / 14.7.
//!
//! | rule | crossings | queues | motorway | kept |
//! |---|---|---|---|---|
//! | along the road only, a standing box is forgotten | 37.5 / 23.0 | 24.3 / 10.1 | 19.9 / 17.8 | |
//! | [motion] without a heading beside it, gaps of 1.6 m in a queue | 29.1 / 17.8 | 22.7 / 11.8 | 19.7 / 18.7 | yes |
//! | what stands and what moves is not joined, outline less azimuth's noise | 31.0 / 13.8 | 23.6 / 11.4 | 20.1 / 18.0 | yes |
//! | outline and place across remembered by way, not by time | 31-32 / 15-21 | 25-29 / 10 | same | no |
//! | box behind the side that is seen | 32.4 / 13.8 | 21.9 / 10.9 | 20.6 / 15.6 | yes |
//! | as long as its proven height implies | 31.6 / 13.5 | 20.9 / 11.4 | 20.4 / 15.9 | yes |
//! | own heading only where known to a quarter of a radian | 25.3 / 17.3 | 20.8 / 12.1 | 20.5 / 15.1 | yes |
//! | outline of what goes its own way follows the place seen | 26.7 / 13.8 | 20.7 / 12.3 | same | yes |
//! | height proven by one reflection in 8 or 12, not 20 | 27.2 / 13.7 | 20.9 / 12.2 | same | no |
//! | length remembered for 10 s at any speed | 23.8 / 18.0 | 18.8 / 13.2 | 20.0 / 16.8 | no |
//! | [shadows](crate::grid::shadow) with exact ends, not through cells | 25.1 / 14.2 | 19.4 / 12.7 | 19.1 / 15.9 | yes |
//! | middle of what is seen shown: objects' FIR 14.0 to 7.5 and 12.5 to 5.8 | 25.4 / 14.1 | 19.9 / 12.6 | 19.3 / 15.8 | no: right of what is detected by construction |
//! | length remembered for 3 s below 4 m/s | 24.8 / 15.0 | 19.3 / 12.8 | same | yes |
//! | low or tall by [all heights](tallness), low at any length | 28.1 / 10.6 | 37.2 / 8.8 | 23.7 / 13.0 | no |
//! | the same, low only below 9 m | 24.4 / 14.0 | 19.7 / 12.2 | 17.8 / 14.6 | yes |
//! | what moves in a standing, unseen box is its departure | 24.5 / 14.1 | 19.7 / 12.2 | 17.8 / 14.7 | yes |
//!
//! The next can tell whether a rule of the table above holds from other poles; its traffic is the same, so it cannot tell whether it holds on other days.
//! The same with five more mounts on the traffic of the training scenes (x, y, height, yaw, seed): crossing train-1 at
//! (18, 17, 4.5 m, -150, 5101) and (-72, -13, 7 m, 5, 5102), train-2 at (-22.2, -10.5, 5 m, 25, 5103); queue train-1 at
//! (-10, 0, 7.5 m, 0, 5104), train-2 at (0, -17.5, 5 m, 5, 5105).
//!
//! | rule | crossings | queues | motorway | kept |
//! |---|---|---|---|---|
//! | the rules kept above | 24.3 / 17.0 | 18.7 / 10.4 | 17.6 / 14.7 | |
//! | a mover after 1 m instead of 2 m of way | 23.7 / 16.3 | 18.4 / 10.4 | same | yes |
//! | speed along a kept heading from the places seen, not from Doppler alone | 23.3 / 16.0 | 18.5 / 10.1 | same | yes |
//! | own way from a fifth of the speed to the side, not a quarter | 22.5 / 15.1 | 18.5 / 9.9 | 16.8 / 15.5 | yes |
//! | box behind its side only where that is most of what is seen, for what is shorter than 8 m | 22.8 / 16.0 | 18.9 / 10.2 | 17.3 / 14.6 | no |
//!
//! The last line was measured without the fourth. The next can tell what helps at crossings of several layouts, and what that
//! costs vehicles; on queues, of which it has no more than before, it can tell less.
//! With three more crossings on other layouts and seeds (traffic made as
//! in `tests/recordings/crossing/traffic.sh`, 90 s: skewed, seed 1003, cycle 90 s, scale 0.9, turned by 20 degrees, radar
//! at (-64, -8, 6 m, 15), seed 5106; tee, 1004, 80 s, 1.1, by 9 degrees, (24, -20, 6 m, 148), 5107; wide, 1005, 90 s,
//! 1.1, (-24, 21, 7 m, -42), 5108; masts and parked cars of `skewed-2`, `tee-2` and `wide-1`). Counted
//! from the 30th second on; objects are those at crossings, from `geometry-slice`:
//!
//! | rule | crossings | objects | queues | kept |
//! |---|---|---|---|---|
//! | the rules kept above | 23.7 / 16.0 | +9.4 / +12.1 | 19.2 / 9.5 | |
//! | what is low for certain is not joined to more than 9 m, nor stretched beyond | 25.9 / 13.1 | +11.5 / +10.1 | 19.6 / 9.2 | yes |
//! | longer ones are low where no part between gaps is longer than 6 m | 26.4 / 12.2 | +12.1 / +9.0 | 19.7 / 9.1 | no: lorries seen at both ends only |
//! | what goes its own way 0.6 m wider to either side | 22.6 / 15.1 | +8.3 / +11.5 | 19.2 / 9.7 | yes |
//! | height of all unmoving things measured against a prior of 1.5 m, not 0.4 m | 20.0 / 15.6 | +6.2 / +11.9 | 18.8 / 10.1 | no: guard rails |
//! | [the same](crate::grid::evidence) where three reflections lie within 3 m | 21.2 / 15.3 | +7.2 / +11.6 | 19.2 / 9.7 | yes |
//! | what was measured half a standard deviation above a level fills it | 20.7 / 15.4 | +6.9 / +11.6 | 19.1 / 9.7 | yes |
//! | longer ones are low where each part between gaps is as long as a car, 2.5 to 6 m | 21.0 / 15.0 | +7.2 / +11.1 | 19.2 / 9.6 | yes |
//! | joining parts moves the free motion's place too: no push to the side | 21.8 / 14.3 | +9.0 / +10.0 | 19.4 / 9.7 | yes |
//! | own way from 1.5 m/s to the side | 21.7 / 13.6 | +8.8 / +9.4 | 19.3 / 10.4 | yes |
//! | what is low and long keeps its ends, up to 0.5 m beyond the outline | 21.7 / 14.3 | +9.3 / +9.9 | 19.0 / 10.2 | yes: lorries that show nothing high |
//! | four reflections within 2.5 m: guard rails with a post every 2 m | 21.8 / 14.3 | +9.4 / +9.9 | 19.0 / 10.2 | yes |
//! | what reflects higher than a car is twice as high | 20.7 / 15.3 | +8.7 / +9.9 | 18.7 / 10.2 | yes |
//! | 0.4 m wider to either side, not 0.6: the motorway's cells 15.0 / 17.1, not 14.6 / 17.9 | 21.5 / 14.8 | +9.7 / +9.7 | 18.9 / 10.0 | yes |
//! | own way from 0.15 of the speed to the side, not a fifth | 21.4 / 13.9 | +8.5 / +9.1 | 18.9 / 10.1 | yes |
//! | its outline follows the place seen by a tenth a frame, not a twentieth | 21.2 / 13.8 | +8.8 / +8.9 | 18.8 / 10.1 | yes |
//! | 0.6 m wider where it goes across the road, more than 14.5 degrees off its axis | 20.5 / 14.5 | +8.0 / +9.3 | 18.8 / 10.1 | yes |
//! | low from elevations better than 1.5 m only (measured before the last four): motorways' FIR rises by 2 points | 21.2 / 15.2 | +6.9 / +10.2 | 18.2 / 10.7 | no |
//! | small boxes for what reflects weakly, once a frame (before the last four): cars in queues, mostly hidden, do too | 21.6 / 14.6 | +9.7 / +9.8 | 20.4 / 10.0 | no |
//! | place across remembered for 0.8 s, not 1 s | 19.0 / 15.2 | +5.9 / +10.0 | 18.6 / 9.9 | yes |
//! | what stands and should be seen is given up in 3/5 of the time, 0.3 m wider along the road | 19.1 / 15.1 | +6.1 / +9.9 | 18.7 / 9.4 | yes |
//!
//! The next can tell what exact lanes are worth; learnt ones need not be worth as much. Its motorways are other recordings than above.
//! On the same scenes, and with the lanes of their nets as `viewshed lanes` makes them; objects at crossings and the
//! cells of thirteen motorways, from the 30th second on:
//!
//! | rule | crossings | objects | queues | motorways | kept |
//! |---|---|---|---|---|---|
//! | the rules kept above | 19.1 / 15.1 | +6.1 / +9.9 | 18.7 / 9.4 | 18.8 / 10.4 | |
//! | what Doppler would make faster than 45 m/s along the road goes along the line of sight, from 3 m/s | 18.6 / 15.0 | +5.9 / +9.8 | same | same | yes |
//! | faster than 20 m/s: motorways' traffic beside the radar | 19.5 / 14.5 | +5.9 / +9.6 | 19.2 / 10.0 | worse by 6 points | no |
//! | faster than 35 m/s | 18.8 / 14.7 | +5.4 / +9.6 | same | same | no: 2 points more on another generator's crossing |
//! | confirmed by 2.25 detections, not 3, and 0.7 m wider across the road, not 0.6 | 17.9 / 15.2 | +5.2 / +9.9 | 18.5 / 9.5 | +0.2 FIR | yes |
//! | own way from 2.6 standard deviations; heading from 3.5 | 19.3 / 15.6, 19.2 / 14.4 | +7.6 / +10.2, +7.4 / +9.3 | same | same | no |
//! | [lanes]: heading only, no margin | 19.1 / 14.3 | +3.4 / +10.6 | none given | | |
//! | and 0.6 of the way to the middle of the lane | 18.0 / 14.1 | +3.7 / +10.7 | | | yes |
//! | and a quarter of the margin to either side | 16.3 / 15.0 | +1.7 / +11.6 | | | yes |
//! | and turned about the middle, not the anchor | 15.7 / 14.9 | +1.6 / +11.4 | | | yes |
//! | with what was kept for all | 15.4 / 15.1 | +1.2 / +11.7 | | | yes |
//!
//! The next can tell whether a rule holds for another generator's traffic, in one crossing (90 s) and one queue (60 s) of it: not how much it is worth there.
//! With sixteen recordings of the twin, eight crossings, four queues and four motorways, none of them reported, and a crossing and a creeping
//! queue of another generator; from the 30th second on, objects again from `geometry-slice`:
//!
//! | rule | crossings | queues | other crossing's objects | other queue's objects | kept |
//! |---|---|---|---|---|---|
//! | the rules kept above | 19.1 / 15.4 | 19.7 / 9.0 | +11.0 / +13.9 | -10.2 / +33.9 | |
//! | what begins behind a face (`joining.rs`) by less than a car and a gap is its other end | 19.0 / 15.5 | 19.7 / 9.0 | +10.0 / +8.1 | -10.6 / +33.0 | yes |
//! | and two ends as far apart as a car's are one car's | 19.0 / 15.4 | 19.6 / 9.0 | +12.0 / +8.0 | -10.0 / +28.2 | yes |
//! | ends before they are confirmed, too | 19.0 / 15.5 | 19.5 / 9.3 | +12.0 / +8.0 | -9.4 / +34.3 | no |
//!
//! The next shows what trades one rate for the other; its lines are alternatives to each other, none was tried with the others.
//! On top of the first line above, with motorways' cells where these changed (15.9 / 16.8):
//!
//! | rule | crossings | queues | motorways | kept |
//! |---|---|---|---|---|
//! | parts are one where their distance stays while their speed changes by 1.5 m/s | 18.5 / 16.0 | 19.7 / 9.0 | same | no |
//! | parts that stand and touch are one, along the line between their middles | 18.1 / 15.8 | 19.5 / 9.0 | same | no |
//! | what goes its own way by less than 30 degrees keeps its outline | 18.9 / 16.4 | 19.7 / 9.2 | 15.4 / 17.6 | no |
//! | as high as its greatest length of the last 30 s implies | 18.5 / 16.1 | 19.0 / 9.2 | 15.8 / 17.0 | no |
//! | tall of 2.6, 3.1 or 4 m, with strays, in place of one height | 19.0 / 15.2 | 20.7 / 8.8 | 16.9 / 16.3 | no |
//! | heights of a car spread by 0.55 m, as they are measured, not 0.35 m | 19.4 / 14.9 | 19.9 / 8.8 | 16.3 / 16.2 | no |
//!
//! What is not kept there buys one rate with the other. The next says where errors lay then, not what can be had: with the truth in place of
//! several things at once effects do not add up. For today, see `viewshed replay --causes`. Where the rest lies: exact shadows of the boxes at those crossings are
//! 16.4 / 17.0, and with the truth in place of some of them
//!
//! | truth in place of | crossings |
//! |---|---|
//! | what stands and was never seen moving, nearly all of it masts: all that a background learnt over minutes could tell | 14.7 / 16.0 |
//! | what stands and moved before | 9.9 / 11.8 |
//! | what turns; crosses; goes along the road | 15.4 / 15.7; 14.4 / 13.9; 13.0 / 13.3 |
//! | long vehicles in several boxes; in one | 12.3 / 15.8; 13.6 / 14.6 |
//! | all others in one box, which is drawn wider than it is known to be | 16.4 / 7.2 |
//! | the height of every box; its place, heading and length | 12.5 / 17.8; 13.6 / 11.4 |
//! | every box; every vehicle without one | 8.1 / 1.9; 12.2 / 17.0 |
//!
//! The last can tell what one rule does to vehicles in queues; the other generator's queue is one minute, counted from its first second on.
//! In the creeping queue of another generator boxes from 60 to 150 m ahead lay 0.5 to 0.8 m too near to the sensor's side, their
//! ends hidden (`hidden_end.rs`). Cells, and objects from slice, there and in the eight training queues of `tests/recordings/tuning.toml`:
//!
//! | rule | training | objects | other queue | objects | kept |
//! |---|---|---|---|---|---|
//! | the rules kept above | 19.9 / 10.0 | +10.7 / +7.0 | 12.4 / 9.2 | +0.0 / +21.7 | |
//! | below 4 m/s behind the side where the end is hidden | 19.5 / 10.1 | +13.2 / +4.7 | 12.3 / 8.6 | +0.9 / +16.6 | yes |
//! | and there all of the noise taken off the spread: crossings' FVR +0.3 | 19.6 / 10.2 | +13.5 / +4.5 | 12.5 / 8.3 | +1.4 / +13.8 | yes |
//! | everywhere: motorways' cells 15.8 / 8.8, not 15.5 / 8.9 | 19.9 / 10.3 | +13.6 / +4.5 | 12.4 / 8.2 | +1.4 / +13.8 | no |
//! | what is lower than 3 m only | 20.4 / 9.8 | +13.3 / +5.6 | 12.5 / 8.6 | +0.8 / +15.5 | no |
//!
//! What farther ends (`room.rs`), [radar cross sections](reflectivity), Doppler's slope (`doppler_slope.rs`), fixtures (`fixtures.rs`) and headings
//! that turn by the way that is made (`own_way.rs`) gave stands there.

mod body;
#[cfg(test)]
mod by_hand;
pub mod config;
mod doppler_slope;
mod fixtures;
mod gathered;
mod hidden_end;
mod joining;
mod lane;
pub mod lanes;
pub mod learnt_lanes;
pub mod motion;
mod newborn;
pub mod obstacle;
mod own_way;
pub mod profile;
pub mod reflectivity;
mod room;
mod search;
pub mod size;
pub mod solid;
#[cfg(test)]
mod stops;
pub mod tallness;
pub mod tracking;

use heapless::Vec;

use crate::fixed::time::{Phase, Step};
use crate::frame::by_range::ByRange;
use crate::frame::reflection::Reflection;
use crate::obstacles::solid::Solid;
use fixtures::Fixtures;
use learnt_lanes::LearntLanes;
use obstacle::Obstacle;
use tracking::Tracking;

/// How far behind the sensor an obstacle is followed, centimetres.
const BEHIND_CM: i32 = -2000;

/// The obstacles of one sensor.
#[derive(Debug, Clone)]
pub struct Obstacles<const N: usize> {
    list: Vec<Obstacle, N, u16>,
    lanes: LearntLanes<N>,
    fixtures: Fixtures<N>,
    dropped: u32,
    phase: Phase,
}

/// Which detections found an obstacle: a flag each, in the scan's order.
#[derive(Debug, Clone, Copy)]
pub struct Claimed<const D: usize>([bool; D]);

impl<const D: usize> Claimed<D> {
    const NONE: Self = Self([false; D]);

    /// Whether detection `i` belongs to an obstacle.
    pub fn contains(&self, i: usize) -> bool {
        self.0.get(i).copied().unwrap_or(false)
    }

    fn insert(&mut self, i: usize) {
        if let Some(flag) = self.0.get_mut(i) {
            *flag = true;
        }
    }
}

impl<const N: usize> Default for Obstacles<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Obstacles<N> {
    /// No obstacles.
    pub const fn new() -> Self {
        Self { list: Vec::new(), lanes: LearntLanes::new(), fixtures: Fixtures::new(), dropped: 0, phase: Phase::START }
    }

    /// Forgets all but the lanes they drove on and the fixtures beside them.
    pub fn clear(&mut self) {
        self.list.clear();
        self.phase = Phase::START;
    }

    /// Forgets the [lanes](learnt_lanes) and fixtures that were learnt.
    pub fn forget_what_was_learnt(&mut self) {
        self.lanes.clear();
        self.fixtures.clear();
    }

    /// All, confirmed or not.
    pub fn iter(&self) -> impl Iterator<Item = &Obstacle> {
        self.list.iter()
    }

    /// New obstacles that found no room, saturating; where none would find any, one for the frame.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Boxes of the confirmed.
    pub fn solids<'a>(&'a self, t: &'a Tracking) -> impl Iterator<Item = Solid> + 'a {
        self.confirmed(t).map(|o| o.solid(t))
    }

    fn confirmed<'a>(&'a self, t: &'a Tracking) -> impl Iterator<Item = &'a Obstacle> {
        self.list.iter().filter(|o| o.existence >= t.confirmed && o.age >= 2 && o.is_mover(t))
    }

    /// Takes one frame's detections: moves every obstacle on, gives each detection to the obstacle
    /// it fits best, starts new ones from the rest, joins parts of one vehicle and drops what is no
    /// longer believed in. `in_view` says whether a place is in plain view (by the previous map).
    pub fn step<const D: usize>(
        &mut self,
        reflections: &[Reflection],
        by_range: &ByRange<D>,
        step: Step,
        t: &Tracking,
        in_view: impl Fn(i32, i32) -> bool,
    ) -> Claimed<D> {
        let kept = t.kept_over(step);
        for o in &mut self.list {
            o.predict(step, kept.lateral, t);
            o.keep_to_learnt(&self.lanes, t);
        }
        let of_fixtures = self.of_fixtures(reflections, by_range, t);
        let mut claimed = self.associate(reflections, by_range, &of_fixtures, kept.outline, t);
        for o in &mut self.list {
            o.settle(step, t);
            o.look_for_learnt(&self.lanes, t);
        }
        self.found(reflections, by_range, &of_fixtures, &mut claimed, t);
        self.learn_fixtures(reflections, by_range, &claimed, step, t, &in_view);
        self.join_parts(t);
        self.look_for_room(t);
        self.list.iter_mut().for_each(|o| o.look_for_end(t, &in_view));
        self.doubt_the_unseen(step, t, in_view);
        self.list.iter_mut().for_each(|o| o.teach(&mut self.lanes, t));
        claimed
    }

    /// Moves all on over a gap in the frames in which nobody looked. What moves is believed in for seconds, what stands for
    /// as long as a red light lasts, and neither what was not confirmed.
    pub fn bridge(&mut self, gap: Step, t: &Tracking) {
        let (mut left, second) = (gap, Step::from_micros(1_000_000));
        self.list.retain(|o| o.existence >= t.confirmed);
        for o in self.list.iter_mut().filter(|o| o.is_standing(t)) {
            o.existence = o.existence.saturating_sub(gap.times(t.standing_hidden_loss));
        }
        while left.raw() > 0 && self.list.iter().any(|o| !o.is_standing(t)) {
            let step = left.min(second);
            left = left.less(step);
            let kept = t.kept_over(step);
            for o in self.list.iter_mut().filter(|o| !o.is_standing(t)) {
                o.predict(step, kept.lateral, t);
                o.keep_to_learnt(&self.lanes, t);
                o.existence -= step.times(t.hidden_loss);
            }
            self.list.retain(|o| o.existence > 0 && o.is_within_reach(t));
        }
        self.list.retain(|o| o.existence > 0);
    }

    /// Gives each detection to the obstacle it fits best, or else to the one whose wheel it may be; of
    /// equals, to the elder in the list. What is of fixtures belongs to none.
    #[allow(clippy::cast_possible_truncation)] // the list is bounded
    fn associate<const D: usize>(
        &mut self,
        reflections: &[Reflection],
        by_range: &ByRange<D>,
        of_fixtures: &Claimed<D>,
        outline_kept: i32,
        t: &Tracking,
    ) -> Claimed<D> {
        const { assert!(N < u16::MAX as usize) }
        const NONE: (i32, u16) = (i32::MAX, u16::MAX);
        let mut best = [(NONE, NONE); D];
        let mut moving = Claimed::<D>::NONE;
        for (i, _) in reflections.iter().enumerate().filter(|(_, r)| t.course(r).is_some()) {
            moving.insert(i);
        }
        for (k, o) in self.list.iter().enumerate() {
            let search = o.search(t);
            let confirmed = o.existence >= t.confirmed;
            let (from, to) = search.distances_cm();
            for place in by_range.between(from, to) {
                if !search.reaches(place.x_cm, place.y_cm) {
                    continue;
                }
                let i = usize::from(place.index);
                if of_fixtures.contains(i) {
                    continue;
                }
                let (Some(r), Some((body, wheel))) = (reflections.get(i), best.get_mut(i)) else { continue };
                let Some(offset) = search.offset(r, t) else { continue };
                let error = search.speed_error(r);
                if error <= t.doppler_gate {
                    if let Some(misfit) = search.misfit(r, offset, error, t)
                        && misfit < body.0
                    {
                        *body = (misfit, k as u16);
                    }
                } else if confirmed
                    && body.1 == u16::MAX
                    && moving.contains(i)
                    && search.is_speed_of_wheel(r, t)
                    && let Some(misfit) = search.misfit(r, offset, 0, t)
                    && misfit < wheel.0
                {
                    *wheel = (misfit, k as u16);
                }
            }
        }
        let mut claimed = Claimed::NONE;
        for (i, (r, ((_, body), _))) in reflections.iter().zip(&best).enumerate() {
            let Some(o) = self.list.get_mut(usize::from(*body)) else { continue };
            if !o.seen() {
                o.fade_outline(outline_kept);
            }
            o.absorb(r, t);
            claimed.insert(i);
        }
        for (i, (r, (_, (_, wheel)))) in reflections.iter().zip(&best).enumerate() {
            if claimed.contains(i) {
                continue;
            }
            let Some(o) = self.list.get_mut(usize::from(*wheel)) else { continue };
            o.absorb_wheel(r);
            claimed.insert(i);
        }
        claimed
    }

    /// Joins obstacles that are parts of one vehicle: the one with more detections takes the other,
    /// which is left without evidence and so dropped. So is what lies within a vehicle, unless one of them stands and the other
    /// is not seen: then it is that vehicle itself, which leaves, or another that one only seems to have reached.
    fn join_parts(&mut self, t: &Tracking) {
        let mut rest = self.list.as_mut_slice();
        while let Some((a, others)) = rest.split_first_mut() {
            for b in others.iter_mut().filter(|b| b.existence > 0) {
                if a.existence <= 0 {
                    break;
                }
                if !a.is_near(b, t) {
                    continue;
                }
                let (elder, younger) = if a.hits >= b.hits { (&mut *a, b) } else { (b, &mut *a) };
                if elder.is_one_with(younger, t) {
                    elder.join(younger, t);
                    younger.existence = 0;
                } else if elder.may_be_leaving_as(younger, t) {
                    if younger.existence >= t.confirmed {
                        younger.inherit(elder);
                        elder.existence = 0;
                    }
                } else if elder.takes_away(younger, t) {
                    younger.existence = 0;
                }
            }
            rest = others;
        }
    }

    /// Takes evidence from obstacles nobody saw, quickly where they should have been seen, and
    /// drops those without evidence or out of reach.
    fn doubt_the_unseen(&mut self, step: Step, t: &Tracking, in_view: impl Fn(i32, i32) -> bool) {
        for o in &mut self.list {
            if o.seen() || o.existence <= 0 {
                continue;
            }
            let places = [o.extent.front_cm, o.extent.middle_cm(), o.extent.rear_cm];
            let loss = if o.existence < t.confirmed {
                t.tentative_loss
            } else {
                let seen = places.iter().any(|&along| {
                    let (x, y) = o.global(along, 0);
                    in_view(x, y)
                });
                match (o.is_standing(t), seen) {
                    (false, true) => t.visible_loss,
                    (false, false) => t.hidden_loss,
                    (true, true) => t.standing_visible_loss,
                    (true, false) => t.standing_hidden_loss,
                }
            };
            o.existence -= self.phase.times(step, loss);
        }
        self.phase = self.phase.after(step);
        self.list.retain(|o| o.existence > 0 && !o.is_fixture(t) && !o.is_a_mast(t) && o.is_within_reach(t));
    }
}

#[cfg(test)]
mod tests {
    use super::by_hand::{rules as tracking, seen_at};
    use super::*;
    use crate::fixed::trig::Direction;
    use std::vec::Vec as StdVec;

    fn reflection(x_cm: i32, y_cm: i32, radial_velocity_cm_s: i16) -> Reflection {
        Reflection { ground_cm: x_cm as u16, sight: Direction::AHEAD, ..seen_at(x_cm, y_cm, radial_velocity_cm_s) }
    }

    fn sorted<const D: usize>(reflections: &[Reflection]) -> ByRange<D> {
        ByRange::sort(reflections, tracking().limit_cm)
    }

    /// One obstacle with so much evidence; what it loses in a tenth of a second without a detection.
    fn lost(existence: i32, in_view: impl Fn(i32, i32) -> bool) -> i32 {
        let mut all = Obstacles::<4>::new();
        let mut o = Obstacle::new(&reflection(5000, 0, 0), Direction::AHEAD, 2000);
        (o.existence, o.extent) = (existence, profile::Extent { rear_cm: -200, front_cm: 200 });
        let _ = all.list.push(o);
        let _: Claimed<4> = all.step(&[], &sorted(&[]), Step::from_micros(100_000), &tracking(), in_view);
        existence - all.iter().next().map_or(0, |o| o.existence)
    }

    #[test]
    fn what_is_unseen_is_doubted_quickly_in_view_and_slowly_in_a_shadow() {
        let t = tracking();
        let tenth = |per_s: i32| Step::from_micros(100_000).times(per_s);
        let confirmed = t.confirmed + 1000;
        assert_eq!(lost(confirmed, |_, _| false), tenth(t.hidden_loss));
        assert_eq!(lost(confirmed, |_, _| true), tenth(t.visible_loss));
        // it is at 52 m by then; one end in view is enough
        assert_eq!(lost(confirmed, |x, _| x > 5350), tenth(t.visible_loss));
        assert_eq!(lost(confirmed, |x, _| x < 5050), tenth(t.visible_loss));
        assert_eq!(lost(confirmed, |x, _| x > 5450), tenth(t.hidden_loss));
        assert_eq!(lost(t.confirmed - 1, |_, _| true), tenth(t.tentative_loss));
        assert!(t.hidden_loss < t.visible_loss && t.visible_loss < t.tentative_loss);
    }

    #[test]
    fn over_a_gap_what_moves_is_believed_in_for_seconds_and_what_stands_for_a_minute() {
        let t = tracking();
        let after = |speed: i32, gap_s: u64| {
            let mut all = Obstacles::<4>::new();
            let mut o = Obstacle::new(&reflection(5000, 0, 0), Direction::AHEAD, speed);
            (o.existence, o.travelled_cm) = (t.existence_max, 1000);
            let _ = all.list.push(o);
            all.bridge(Step::from_micros(gap_s * 1_000_000), &t);
            all.iter().next().map(|o| (o.anchor().0, o.existence > t.confirmed))
        };
        assert_eq!(after(2000, 3), Some((11_000, true)), "60 m on");
        assert_eq!(after(-2000, 2), Some((1000, true)));
        assert_eq!(after(2000, 10), None);
        assert_eq!(after(0, 59), Some((5000, true)));
        let mut all = Obstacles::<4>::new();
        let mut tentative = Obstacle::new(&reflection(5000, 0, 0), Direction::AHEAD, 2000);
        tentative.existence = t.confirmed - 1;
        let _ = all.list.push(tentative);
        all.bridge(Step::from_micros(100_000), &t);
        assert_eq!(all.iter().count(), 0, "what was not confirmed is forgotten");
    }

    #[test]
    fn a_full_list_gives_up_its_weakest_for_what_has_more_evidence() {
        let t = tracking();
        let mut all = Obstacles::<2>::new();
        let of = |existence| {
            let mut o = Obstacle::new(&reflection(5000, 0, 0), Direction::AHEAD, 2000);
            o.existence = existence;
            o
        };
        [300, 500].map(of).into_iter().for_each(|o| all.admit(o, &t));
        let evidence = |all: &Obstacles<2>| all.iter().map(|o| o.existence).collect::<StdVec<_>>();
        all.admit(of(400), &t);
        assert_eq!((evidence(&all), all.dropped()), ([400, 500].to_vec(), 0));
        all.admit(of(350), &t);
        assert_eq!((evidence(&all), all.dropped()), ([400, 500].to_vec(), 1));
        [900, 1000].map(of).into_iter().for_each(|o| all.admit(o, &t));
        all.admit(of(5000), &t);
        assert_eq!((evidence(&all), all.dropped()), ([900, 1000].to_vec(), 2), "the confirmed stay");
    }

    #[test]
    fn the_part_with_more_detections_takes_the_other() {
        let t = tracking();
        let mut all = Obstacles::<2>::new();
        for (x, hits) in [(5000, 5), (5500, 50)] {
            let mut o = Obstacle::new(&reflection(x, 0, 0), Direction::AHEAD, 2000);
            (o.existence, o.hits) = (1000, hits);
            let _ = all.list.push(o);
        }
        all.join_parts(&t);
        let left: StdVec<(i32, u16)> = all.iter().map(|o| (o.existence, o.hits)).collect();
        assert_eq!(left, [(0, 5), (2000, 55)]);
    }

    #[test]
    fn a_detection_goes_to_the_obstacle_it_fits_best() {
        let t = tracking();
        let mut all = Obstacles::<4>::new();
        // together longer than any vehicle
        for (x, front_cm) in [(6200, 1250), (5000, 25)] {
            let mut o = Obstacle::new(&reflection(x, 0, 0), Direction::AHEAD, 2000);
            (o.existence, o.extent) = (t.confirmed, profile::Extent { rear_cm: -25, front_cm });
            let _ = all.list.push(o);
        }
        let seen = [reflection(5450, 0, 2000)];
        let claimed: Claimed<4> = all.step(&seen, &sorted(&seen), Step::from_micros(0), &t, |_, _| false);
        assert!(claimed.contains(0) && !claimed.contains(1));
        assert_eq!(all.iter().map(|o| o.hits).collect::<StdVec<_>>(), [0, 1], "7 m from one, 4 m from the other");
    }

    #[test]
    fn boxes_are_of_the_confirmed_and_what_has_no_evidence_left_or_is_behind_the_sensor_goes() {
        let t = tracking();
        let after = |x, existence| {
            let mut all = Obstacles::<4>::new();
            let mut o = Obstacle::new(&reflection(x, 0, 0), Direction::AHEAD, 2000);
            (o.existence, o.age) = (existence, 5);
            let _ = all.list.push(o);
            let _: Claimed<4> = all.step(&[], &sorted(&[]), Step::from_micros(200_000), &t, |_, _| false);
            (all.iter().count(), all.solids(&t).count())
        };
        assert_eq!(after(5000, t.confirmed + 1000), (1, 1));
        assert_eq!(after(5000, t.confirmed - 1), (1, 0));
        assert_eq!(after(5000, 1), (0, 0));
        assert_eq!(after(BEHIND_CM - 500, t.confirmed + 1000), (0, 0));
        assert_eq!(after(t.limit_cm, t.confirmed + 1000), (0, 0));
    }

    #[test]
    fn a_frame_starts_half_as_many_as_there_is_room_for() {
        let (t, mut all) = (tracking(), Obstacles::<4>::new());
        let seen = [-900, -300, 300, 900].map(|y| reflection(5000, y, 2000));
        let _: Claimed<4> = all.step(&seen, &sorted(&seen), Step::from_micros(0), &t, |_, _| true);
        assert_eq!(all.iter().count(), 2);
        let _: Claimed<4> = all.step(&seen, &sorted(&seen), Step::from_micros(1), &t, |_, _| true);
        assert_eq!(all.iter().count(), 4);
    }

    #[test]
    fn only_confirmed_movers_become_boxes() {
        let (t, mut all, mut frames) = (tracking(), Obstacles::<4>::new(), 0);
        while all.solids(&t).next().is_none() {
            assert!(frames < 20, "never");
            let seen = [reflection(5000 + 133 * frames, 0, 2000), reflection(5200 + 133 * frames, 0, 2000)];
            let _: Claimed<4> = all.step(&seen, &sorted(&seen), Step::from_micros(66_667), &t, |_, _| true);
            frames += 1;
        }
        // after 2 m of way, which takes it two frames after the first
        assert_eq!(frames, 3);
    }
}
