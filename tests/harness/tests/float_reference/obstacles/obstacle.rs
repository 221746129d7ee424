//! One moving obstacle: place, motion and outline; metres, seconds, levelled frame.

use viewshed_harness::geometry::solid::Solid;

use super::off_axis::FreeMotion;
use super::outline::{BIN_M, Extent, Profile, Reflectivity, TALL, Tallness, least_length, size};
use super::rules::Rules;
use crate::geometry::{Ground, Placed, across, along, difference, left, moved};

/// How far a reflection may lie off the middle of a vehicle, standard deviation in metres.
const ON_VEHICLE_SIGMA: f64 = 0.5;
/// How far beyond the longest vehicle an outline may be stretched.
const LENGTH_TO_SPARE: f64 = 1.0;
/// Fastest drift to one side that turns a heading, m/s.
const FASTEST_DRIFT: f64 = 1.0;
/// Variance across a car that reflects on both its sides alike, m^2, and most it can be.
const EVEN_SPREAD: f64 = 0.85 * 0.85;
/// Detections over which the spread to the sides is taken.
const SPREAD_MEMORY: f64 = 40.0;

#[derive(Debug, Clone)]
pub struct Obstacle {
    /// A point on the centre line that moves along.
    pub anchor: Ground,
    pub velocity: Ground,
    pub heading: Ground,
    pub profile: Profile,
    pub extent: Extent,
    /// Inverse variance of the lateral place, 1/m^2.
    pub lateral_weight: f64,
    /// Variance of where across it the detections lie, m^2.
    spread: f64,
    /// How much of the last frames hid the end that is turned to the sensor.
    hidden_end: f64,
    /// Whether what is seen of it can only be its farther end.
    pub farther_end: bool,
    /// Length it has shown for long.
    shown_length: f64,
    /// Evidence that it is there, detections.
    pub existence: f64,
    pub hits: f64,
    pub age: u32,
    travelled: f64,
    tallness: Tallness,
    reflectivity: Reflectivity,
    pub free: FreeMotion,
    pub unexplained: u32,
    pub free_heading: bool,
    /// rad^2.
    pub heading_variance: f64,
    pub gathered: Gathered,
}

/// Sums over the detections of one frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Gathered {
    pub count: f64,
    /// Projection x error, and projection squared.
    speed: (f64, f64),
    /// Weight x offset, and weights.
    lateral: (f64, f64),
    /// Offsets ahead and to the left, squared ones to the left, radial speed errors.
    pub offset: [f64; 2],
    squares: f64,
    /// Angles from the first line of sight, their squares, and angle x radial speed error.
    pub slope: ([f64; 2], [f64; 3]),
    pub radial: f64,
    /// Of the last.
    pub sight: Ground,
    pub sigma_across: f64,
    /// Greatest, dBsm.
    rcs: Option<f64>,
}

fn length(v: Ground) -> f64 {
    v[0].hypot(v[1])
}

/// How far beyond its outline an end of a vehicle may reflect.
const END: f64 = 0.5;
/// Sine of the angle to the road's axis from which a thing goes across it.
const ACROSS: f64 = 0.25;
/// Greatest length of what is low.
const LONGEST_LOW: f64 = 9.0;

impl Obstacle {
    pub fn new(seed: &Placed, heading: Ground, speed: f64) -> Self {
        Self {
            anchor: seed.at,
            velocity: heading.map(|c| c * speed),
            heading,
            profile: Profile::EMPTY,
            extent: Extent { rear: -BIN_M / 2.0, front: BIN_M / 2.0 },
            lateral_weight: 0.0,
            spread: EVEN_SPREAD,
            hidden_end: 0.0,
            farther_end: false,
            shown_length: 0.0,
            existence: 0.0,
            hits: 0.0,
            age: 0,
            travelled: 0.0,
            tallness: Tallness::default(),
            reflectivity: Reflectivity::default(),
            free: FreeMotion::newborn(seed.at, heading.map(|c| c * speed)),
            unexplained: 0,
            free_heading: false,
            heading_variance: 1.0,
            gathered: Gathered::default(),
        }
    }

    pub fn seen(&self) -> bool {
        self.gathered.count > 0.0
    }

    /// Ahead of the anchor and to its left.
    pub fn local(&self, at: Ground) -> Ground {
        let d = difference(at, self.anchor);
        [along(self.heading, d), across(self.heading, d)]
    }

    /// The place so far ahead of the anchor on the centre line.
    pub fn ahead(&self, by: f64) -> Ground {
        moved(self.anchor, self.heading, by)
    }

    pub fn predict(&mut self, dt: f64, rules: &Rules) {
        self.anchor = moved(self.anchor, self.velocity, dt);
        self.travelled += length(self.velocity) * dt;
        self.free.predict(dt, rules.turning_noise);
        self.lateral_weight *= (-dt / rules.lateral_memory).exp();
        self.gathered = Gathered::default();
        self.age += 1;
    }

    pub fn is_mover(&self, rules: &Rules) -> bool {
        self.travelled >= rules.mover
    }

    pub fn is_fixture(&self, rules: &Rules) -> bool {
        !self.is_mover(rules) && self.age >= 2 && length(self.velocity) < rules.fixture_speed
    }

    pub fn is_standing(&self, rules: &Rules) -> bool {
        self.is_mover(rules) && length(self.velocity) < rules.standing_speed
    }

    /// Whether it stands, shows one point alone, and that is as high as only wide or long vehicles are.
    pub fn is_a_mast(&self, rules: &Rules) -> bool {
        let point = self.extent.length() < 1.5 && self.spread < 0.35;
        let stands = self.seen() && length(self.velocity) < 2.0 * rules.standing_speed;
        let rcs = self.reflectivity.known();
        point && stands && self.is_tall() && !rcs.is_some_and(|rcs| rcs > rules.lorry_rcs)
    }

    /// Measured radial velocity less the one this motion explains.
    fn speed_error(&self, d: &Placed) -> f64 {
        d.radial_velocity - along(d.sight, self.velocity)
    }

    /// Standard deviations of a detection along and across the heading.
    fn spread(&self, d: &Placed, rules: &Rules) -> [f64; 2] {
        let (c, s) = (along(self.heading, d.sight), across(self.heading, d.sight));
        [(rules.range_sigma * c).hypot(d.sigma_across * s), (rules.range_sigma * s).hypot(d.sigma_across * c)]
    }

    /// Longest stretch without reflections within one vehicle: no longer than vehicles keep from each
    /// other at this speed.
    fn gap(&self, rules: &Rules) -> f64 {
        rules.gap.min(self.distance_at(rules.headway, rules))
    }

    /// Distance that vehicles this fast keep at a headway.
    fn distance_at(&self, headway: f64, rules: &Rules) -> f64 {
        rules.standstill + length(self.velocity) * headway
    }

    /// How badly a detection fits; `None` where it cannot belong to this obstacle.
    pub fn misfit(&self, d: &Placed, rules: &Rules) -> Option<f64> {
        self.misfit_with(d, self.speed_error(d), rules)
    }

    /// The same for a wheel, which returns anything between standstill and twice the obstacle's speed.
    pub fn misfit_of_wheel(&self, d: &Placed, rules: &Rules) -> Option<f64> {
        let body = along(d.sight, self.velocity);
        let spun = d.radial_velocity * if body < 0.0 { -1.0 } else { 1.0 };
        let fits = spun >= 0.0 && spun <= 2.0 * body.abs() + rules.doppler_gate;
        self.misfit_with(d, 0.0, rules).filter(|_| fits)
    }

    fn misfit_with(&self, d: &Placed, error: f64, rules: &Rules) -> Option<f64> {
        let [forward, left] = self.local(d.at);
        let [sigma_along, sigma_across] = self.spread(d, rules);
        let beyond = self.extent.beyond(forward);
        let beside = (left.abs() - rules.half_width).max(0.0);
        // far along the vehicle or far to its side, but not both
        let ahead = beyond / (self.gap(rules) + rules.sigmas * sigma_along);
        let aside = beside / (rules.lateral_gate + rules.sigmas * sigma_across);
        let fits = error.abs() <= rules.doppler_gate
            && ahead.hypot(aside) <= 1.0
            && self.extent.length() + beyond <= rules.max_length + LENGTH_TO_SPARE
            && !(self.is_low() && beyond > END && self.extent.length() + beyond > LONGEST_LOW);
        // squared distances in their own scales: 0.7 m along, width and noise across, half a metre a
        // second (twice) in speed
        let across = left.powi(2) / (rules.half_width.powi(2) + sigma_across.powi(2));
        fits.then(|| (beyond / 0.7).powi(2) + across + 2.0 * (error / 0.5).powi(2))
    }

    /// Whether it is low for certain, and so no lorry.
    fn is_low(&self) -> bool {
        self.tallness.ceiling() < f64::INFINITY
    }

    /// Whether it is as tall as a delivery van for certain.
    fn is_tall(&self) -> bool {
        self.tallness.floor() >= TALL
    }

    /// Takes a detection that belongs to it.
    pub fn absorb(&mut self, d: &Placed, rules: &Rules) {
        let [ahead, left] = self.local(d.at);
        let [_, sigma_across] = self.spread(d, rules);
        let projection = along(self.heading, d.sight);
        let error = self.speed_error(d);
        let weight = (ON_VEHICLE_SIGMA.powi(2) + sigma_across.powi(2)).recip();
        let g = &mut self.gathered;
        if g.count == 0.0 {
            g.slope.0 = d.sight.map(|c| c / d.sight[0].hypot(d.sight[1]));
        }
        let angle = across(g.slope.0, d.sight);
        g.slope.1 = [g.slope.1[0] + angle, g.slope.1[1] + angle * angle, g.slope.1[2] + angle * error];
        g.count += 1.0;
        g.speed.0 += projection * error;
        g.speed.1 += projection * projection;
        g.lateral.0 += weight * left;
        g.lateral.1 += weight;
        g.offset = [g.offset[0] + ahead, g.offset[1] + left];
        g.squares += left * left;
        g.radial += error;
        g.sight = d.sight;
        g.sigma_across = d.sigma_across;
        g.rcs = d.rcs.map(|rcs| g.rcs.map_or(rcs, |most| most.max(rcs))).or(g.rcs);
        self.profile.add(ahead, 1.0);
        if let Some((height, sigma)) = d.height {
            self.tallness.add(height, sigma);
        }
    }

    /// Takes a detection of one of its wheels: their Doppler says nothing of its speed.
    pub fn absorb_wheel(&mut self, d: &Placed) {
        let [ahead, _] = self.local(d.at);
        self.profile.add(ahead, 1.0);
    }

    /// Stretches the outline of a newborn to a detection.
    pub fn reach(&mut self, d: &Placed) {
        let [ahead, _] = self.local(d.at);
        self.extent = Extent { rear: self.extent.rear.min(ahead), front: self.extent.front.max(ahead) };
    }

    pub fn fade_outline(&mut self, dt: f64, rules: &Rules) {
        self.profile.fade((-dt / rules.outline_memory).exp());
    }

    /// Brings motion, place and outline up to date with what was absorbed.
    pub fn settle(&mut self, dt: f64, rules: &Rules) {
        let g = self.gathered;
        if !self.seen() {
            return;
        }
        if let Some(rcs) = g.rcs {
            self.reflectivity.add(rcs);
            self.tallness.reflected = self.reflectivity.evidence(rules.lorry_rcs);
        }
        self.follow(rules);
        self.lateral_weight += g.lateral.1;
        let offset = g.lateral.0 / self.lateral_weight;
        if self.free_heading && self.knows_its_way(rules) {
            self.velocity = self.free.velocity;
            self.turn_with_motion(dt);
            self.anchor = moved(self.anchor, left(self.heading), offset);
        } else {
            self.go_along_heading(offset, dt, rules);
        }
        let noise = g.sigma_across * along(self.heading, g.sight);
        let least = if self.hidden_end > 0.5 { -4.0 * EVEN_SPREAD } else { 0.0 };
        let spread = (g.squares / g.count - noise.powi(2)).clamp(least, 4.0 * EVEN_SPREAD);
        self.spread += (spread - self.spread) * g.count / (g.count + SPREAD_MEMORY);
        self.question_heading(rules);
        self.update_extent(rules);
        let off = self.extent.length() - self.shown_length;
        let memory = if off > 0.0 { rules.length_growth } else { rules.length_memory };
        self.shown_length += off * (1.0 - (-dt / memory).exp());
        self.hits += g.count;
        self.existence = (self.existence + g.count.min(rules.most_hits_a_frame)).min(rules.max_evidence);
    }

    /// Corrects the speed along the heading and the place across it, and lets a lasting drift turn it.
    fn go_along_heading(&mut self, offset: f64, dt: f64, rules: &Rules) {
        let (young, g) = (self.age < rules.young, self.gathered);
        if self.free_heading {
            // across the line of sight Doppler says nothing of a speed, and a place that stays does
            self.velocity = self.heading.map(|c| c * along(self.heading, self.free.velocity));
        } else {
            let inertia = if young { rules.young_inertia } else { rules.inertia };
            self.velocity = moved(self.velocity, self.heading, g.speed.0 / (g.speed.1 + inertia));
        }
        self.anchor = moved(self.anchor, left(self.heading), offset);
        if !young {
            let drift = (offset * rules.drift_gain / dt).clamp(-FASTEST_DRIFT, FASTEST_DRIFT);
            self.velocity = moved(self.velocity, left(self.heading), drift);
            let speed = length(self.velocity);
            if speed > rules.turning_speed {
                self.heading = self.velocity.map(|v| v / speed);
            }
        }
    }

    /// Reads the outline and keeps the anchor near its middle.
    fn update_extent(&mut self, rules: &Rules) {
        let Some(extent) = self.profile.extent(rules.outline_min_hits, rules.outline_share) else { return };
        let g = self.gathered;
        // azimuth's noise lengthens what stands across the line of sight
        let noise = rules.outline_sigmas * g.sigma_across * across(self.heading, g.sight).abs();
        let shrink = noise.min(extent.length() / 4.0);
        let extent = Extent { rear: extent.rear + shrink, front: extent.front - shrink };
        self.extent = extent;
        let bins = (extent.middle() / BIN_M).trunc();
        if bins.abs() >= rules.recentre_bins {
            self.recentre(bins);
        }
    }

    /// Moves the anchor forward by whole bins; everything stays where it is.
    fn recentre(&mut self, bins: f64) {
        self.profile.shift(bins as i32);
        let by = bins * BIN_M;
        self.anchor = self.ahead(by);
        self.extent = Extent { rear: self.extent.rear - by, front: self.extent.front - by };
    }

    /// Whether another obstacle is a part of the same vehicle.
    pub fn is_one_with(&self, other: &Self, rules: &Rules) -> bool {
        let [ahead, left] = self.local(other.ahead(other.extent.middle()));
        let half = other.extent.length() / 2.0;
        let (rear, front) = (ahead - half, ahead + half);
        let gap = (rear - self.extent.front).max(self.extent.rear - front);
        let whole = front.max(self.extent.front) - rear.min(self.extent.rear);
        let apart = length(difference(self.velocity, other.velocity));
        let coupled = self.travelled.min(other.travelled) >= rules.coupled_way
            && apart <= rules.coupled_speed
            && left.abs() <= rules.merge_lateral;
        let widest = if coupled { self.distance_at(rules.coupled_headway, rules) } else { self.gap(rules) };
        let uncertain = rules.sigmas * (self.lateral_sigma() + other.lateral_sigma());
        let abreast = if gap <= 0.0 { rules.abreast } else { 0.0 };
        let near =
            gap <= widest && whole <= if self.is_low() && other.is_low() { LONGEST_LOW } else { rules.max_length };
        // the ends of a car that is creeping, or of a van
        let behind_its_face = (ahead > self.extent.middle()) == (along(self.heading, self.anchor) > 0.0);
        let confirmed = self.existence.min(other.existence) >= rules.confirm_hits;
        let (end, over_all) = if self.is_tall() && other.is_tall() { (2.5, 6.6) } else { (2.0, 5.2) };
        let ends = self.extent.length().max(other.extent.length()) <= end;
        let both_ends = confirmed && ends && (4.0..=over_all).contains(&whole);
        let other_end = apart <= 1.0 && ((behind_its_face && whole < 4.8) || both_ends);
        apart <= rules.merge_speed
            && along(self.heading, other.heading) >= rules.merge_parallel
            && left.abs() <= abreast.max(rules.merge_lateral + uncertain)
            && (near || other_end)
            && !self.is_another_car_than(other, (ahead - self.extent.middle()).abs().max(left.abs()), rules)
    }

    /// Whether a whole car and something tall, or two whole cars so far apart.
    fn is_another_car_than(&self, other: &Self, offset: f64, rules: &Rules) -> bool {
        let whole = |o: &Self| {
            let shown = o.extent.length().max(o.remembered_length(rules));
            o.existence >= rules.confirm_hits && o.is_low() && (4.0..=6.0).contains(&shown)
        };
        match (whole(self), whole(other)) {
            (true, true) => offset > 1.0,
            (one, two) => one && other.is_tall() || two && self.is_tall(),
        }
    }

    /// Whether another obstacle lies within this one, where nothing else can be.
    pub fn encloses(&self, other: &Self, rules: &Rules) -> bool {
        let [ahead, left] = self.local(other.ahead(other.extent.middle()));
        left.abs() <= rules.merge_lateral && self.extent.beyond(ahead) <= 0.0
    }

    /// Whether another obstacle lies within this one and is nothing of its own.
    pub fn takes_away(&self, other: &Self, rules: &Rules) -> bool {
        (self.hits / 2.0).floor() >= other.hits && self.encloses(other, rules) && !self.coasts_over(other, rules)
    }

    /// Whether it moves on without being seen, and the other is seen to stand.
    fn coasts_over(&self, other: &Self, rules: &Rules) -> bool {
        let guessed = !self.seen() && !self.is_standing(rules);
        guessed && other.seen() && other.is_standing(rules) && other.existence >= rules.confirm_hits
    }

    /// Whether what moves within this one can be itself, which leaves.
    pub fn may_be_leaving_as(&self, mover: &Self, rules: &Rules) -> bool {
        self.is_standing(rules)
            && !self.seen()
            && mover.seen()
            && length(mover.velocity) > rules.standing_speed
            && self.encloses(mover, rules)
    }

    /// Takes over what was known of the vehicle before it left.
    pub fn inherit(&mut self, before: &Self) {
        self.travelled = self.travelled.max(before.travelled);
        self.shown_length = self.shown_length.max(before.shown_length);
        self.tallness.join(&before.tallness);
        self.reflectivity.join(&before.reflectivity);
    }

    fn lateral_sigma(&self) -> f64 {
        self.lateral_weight.sqrt().recip().min(10.0)
    }

    /// Takes over what another obstacle knows of the same vehicle.
    pub fn join(&mut self, other: &Self, rules: &Rules) {
        // the histogram is no longer than the longest vehicle: its middle first
        let [ahead, _] = self.local(other.anchor);
        let (rear, front) =
            (self.extent.rear.min(ahead + other.extent.rear), self.extent.front.max(ahead + other.extent.front));
        self.recentre(((rear + front) / 2.0 / BIN_M).trunc());
        let [ahead, offset] = self.local(other.anchor);
        self.profile.merge(&other.profile, ahead);
        self.lateral_weight += other.lateral_weight;
        self.anchor = moved(self.anchor, left(self.heading), offset * other.lateral_weight / self.lateral_weight);
        let share = other.gathered.count / (self.gathered.count + other.gathered.count).max(1.0);
        let centre = |k: usize| self.free.place[k] + share * (other.free.place[k] - self.free.place[k]);
        self.free.place = [centre(0), centre(1)];
        self.existence = (self.existence + other.existence).min(rules.max_evidence);
        self.hits += other.hits;
        self.travelled = self.travelled.max(other.travelled);
        self.tallness.join(&other.tallness);
        self.reflectivity.join(&other.reflectivity);
        self.tallness.reflected = self.reflectivity.evidence(rules.lorry_rcs);
        self.update_extent(rules);
    }

    /// Length it has shown for long, while slow.
    fn remembered_length(&self, rules: &Rules) -> f64 {
        if length(self.velocity) < rules.slow { self.shown_length } else { 0.0 }
    }

    /// Whether the end that is turned to the sensor is hidden; what is fast keeps its distance.
    pub fn look_for_end(&mut self, rules: &Rules, in_view: impl Fn(Ground) -> bool) {
        let solid = self.solid(rules);
        let [x, y, _] = solid.center;
        let half = if along(self.heading, [x, y]) > 0.0 { -solid.size[0] / 2.0 } else { solid.size[0] / 2.0 };
        let end = moved([x, y], self.heading, half);
        let in_sight = [-0.5, 0.0, 0.5].iter().all(|s| in_view(moved(end, left(self.heading), s * solid.size[1])));
        let hidden = if length(self.velocity) < rules.slow && !in_sight { 1.0 } else { 0.0 };
        self.hidden_end += (hidden - self.hidden_end) / 4.0;
    }

    /// Whether it is one end of something tall behind which another vehicle, not tall, begins where its rest should be.
    pub fn is_farther_end(&self, others: &[Self], rules: &Rules) -> bool {
        let face = |o: &Self| {
            let ends = [o.extent.rear, o.extent.front].map(|by| along(self.heading, o.ahead(by)));
            let middle = (ends[0] + ends[1]) / 2.0;
            if along(self.heading, self.anchor) > 0.0 {
                (ends[0].min(ends[1]), middle)
            } else {
                (-ends[0].max(ends[1]), -middle)
            }
        };
        let (begins, middle) = face(self);
        let leaves_no_room = |next: &Self| {
            let (next_begins, next_middle) = face(next);
            let [_, left] = self.local(next.ahead(next.extent.middle()));
            next.existence >= rules.confirm_hits
                && next.is_mover(rules)
                && !next.is_tall()
                && along(self.heading, next.heading) >= rules.merge_parallel
                && left.abs() <= rules.merge_lateral
                && next_middle > middle
                && next_begins - begins < self.size(rules)[0]
        };
        self.is_tall()
            && length(self.velocity) < rules.slow
            && self.extent.length() < 3.0
            && others.iter().any(leaves_no_room)
    }

    /// Length, width and height that its outline, what it has shown for long and its proven height imply.
    fn size(&self, rules: &Rules) -> [f64; 3] {
        let tall = least_length(&rules.sizes, self.tallness.floor());
        let (shown, rcs) = (self.extent.length(), self.reflectivity.known());
        if shown < 2.5 && tall == 0.0 && rcs.is_some_and(|rcs| rcs < rules.weak_rcs) {
            // a pedestrian or rider
            return [shown.max(1.8), 0.7, 1.7];
        }
        size(&rules.sizes, shown.max(self.remembered_length(rules)).max(tall))
    }

    /// The box it fills: the outline lengthened to what is usual, behind the face the radar sees, or before it where
    /// that is its farther end.
    pub fn solid(&self, rules: &Rules) -> Solid {
        let [length, width, height] = self.size(rules);
        let middle = self.ahead(self.extent.middle());
        let [ahead, aside] = [along(self.heading, middle), across(self.heading, middle)];
        // behind the end and behind the side that is seen
        let hidden = (length - self.extent.length()).max(0.0) / 2.0;
        let hidden = if self.farther_end { -hidden } else { hidden };
        let (side, end) = (length * aside.abs(), width * ahead.abs());
        let shown = (2.0 * side / (side + end)).min(1.0).max(self.hidden_end);
        let unseen = (width / 2.0 - (self.spread * 1.125).max(0.0).sqrt()).max(0.0) * shown;
        let away = |by: f64, place: f64| if place >= 0.0 { by } else { -by };
        let middle = moved(middle, self.heading, away(hidden, ahead));
        let [x, y] = moved(middle, left(self.heading), away(unseen, aside));
        // what is as long as a lorry may be one that shows nothing high, unless it is several cars in a row or hardly
        // reflects; what is longer than a car and reflects like a lorry may be one, too
        let rcs = self.reflectivity.known();
        let may_be_low = if length >= LONGEST_LOW {
            self.profile.is_a_row_of_cars(&self.extent) || rcs.is_some_and(|rcs| rcs < rules.low_rcs)
        } else {
            self.extent.length() < 5.3 || !rcs.is_some_and(|rcs| rcs > rules.lorry_rcs)
        };
        let lid = if may_be_low { self.tallness.ceiling() } else { f64::INFINITY };
        let height = height.min(lid).max(self.tallness.floor());
        let across = along(left(rules.road), self.heading).abs() > ACROSS;
        let margin = match (self.free_heading, across) {
            (false, _) => 0.0,
            (true, false) => rules.off_axis_margin / 2.0,
            (true, true) => rules.off_axis_margin,
        };
        let yaw_rad = self.heading[1].atan2(self.heading[0]);
        Solid { center: [x, y, height / 2.0], yaw_rad, size: [length, width + 2.0 * margin, height] }
    }
}
