//! A tour through all strokes, and the search for a shorter one.
//!
//! The tour is a ring of strokes, each with its direction, kept as an array. One more stroke, the depot, closes the
//! ring: one of its ends is where the head starts, the other is nowhere, at no distance from anything, so that the tour
//! may end anywhere. Every end of a stroke has one link to an end of another: links are what an exchange replaces.

use std::collections::VecDeque;

use kurbo::Point;

use super::Way;
use super::first::{Link, greedy};
use super::heat::{Heat, LOOKBACK};
use super::near::Near;

/// Neighbours that are tried for the first new link of an exchange, and for the second.
const BREADTH: [usize; 2] = [6, 4];
/// A kick begins at three places that random walks of so many steps, each to a near end, lead to.
const WALK: usize = 8;
/// A kick exchanges two neighbouring pieces of the tour, together no longer than this.
const KICK_SPAN: usize = 500;
/// A kick begins at one of so many strokes that follow each other along the curve.
const WINDOW: usize = 1000;
/// So often kicks go along the whole curve.
const PASSES: usize = 5;
/// No piece longer than this is turned: turning longer ones costs more time than it saves travel.
const REACH: usize = 10_000;
/// Gains below this are rounding, millimetres.
const EPSILON: f64 = 1e-9;

/// An end of a stroke: `2 · stroke + end`. Where a stroke in the tour is entered also tells its direction.
pub(super) type End = u32;

/// The distance of two points. Its arguments are far from where squares overflow, which `hypot` would guard against at
/// ten times the cost.
#[inline]
fn apart(a: Point, b: Point) -> f64 {
    a.distance_squared(b).sqrt()
}

/// An exchange of two or three links: `t[0]`–`t[1]`, `t[2]`–`t[3]` (and `t[4]`–`t[5]`) go; `t[1]`–`t[2]`,
/// `t[3]`–`t[0]` or `t[3]`–`t[4]`, `t[5]`–`t[0]` come.
#[derive(Clone, Copy)]
struct Exchange {
    gain: f64,
    t: [End; 6],
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// Two links.
    Turn,
    /// Three, as two turns one after the other.
    TurnTwice,
    /// Three, of two neighbouring pieces each turned in its place.
    TurnBoth,
    /// Three, of two neighbouring pieces that change places.
    Swap,
}

pub(super) struct Tour<'a> {
    ends: &'a [[Point; 2]],
    returns: bool,
    heat: Heat,
    heats: bool,
    /// Middle and half length of each stroke.
    middles: Vec<(Point, f64)>,
    /// Where the head is when it enters or leaves by an end, the depot's included.
    points: Vec<Point>,
    /// With returns: the end at which each stroke begins and ends.
    chosen: Vec<u8>,
    sequence: Vec<End>,
    /// Where each stroke stands in the sequence.
    place: Vec<u32>,
    near: Near,
    queue: VecDeque<u32>,
    queued: Vec<bool>,
    /// Whether changes may be taken back.
    kicking: bool,
    /// Changes since the last kick, to take them back.
    log: Vec<Change>,
}

#[derive(Clone, Copy)]
enum Change {
    Turned(u32, u32),
    Chosen(u32),
}

/// How many places on a ring of `len` one place is ahead of another.
#[inline]
fn ahead(from: usize, to: usize, len: usize) -> usize {
    if to >= from {
        to - from
    } else {
        to + len - from
    }
}

/// The place on a ring of `len` that is `by`, less than `len`, places ahead.
#[inline]
fn moved(from: usize, by: usize, len: usize) -> usize {
    let to = from + by;
    if to >= len { to - len } else { to }
}

/// Links to near neighbours, before any stroke was told by which end it begins: with returns, all begin at their first.
fn links(near: &Near, start: End, returns: bool) -> Vec<Link> {
    let mut links = Vec::new();
    for a in 0..=start {
        let few = near.of(a).take(BREADTH[0]);
        if !returns {
            links.extend(few.map(|(b, cost)| (cost, a, b)));
        } else if a % 2 == 0 {
            for (b, cost) in few.filter(|(b, _)| b % 2 == 0) {
                links.extend([(cost, a, b), (cost, a, b ^ 1)]);
                if a != start {
                    links.extend([(cost, a ^ 1, b), (cost, a ^ 1, b ^ 1)]);
                }
            }
        }
    }
    links
}

impl<'a> Tour<'a> {
    /// A first tour: the cheapest links first.
    pub(super) fn new(ends: &'a [[Point; 2]], start: Point, way: Way, heat: Heat) -> Self {
        let n = ends.len();
        let returns = way == Way::Back;
        let near = Near::find(ends, start, way, heat);
        let mut points: Vec<Point> = ends
            .iter()
            .flat_map(|e| if returns { [e[0]; 2] } else { *e })
            .collect();
        // Entered at the end that is nowhere, left from the start.
        points.extend([start, start]);
        let sequence = greedy(
            &points,
            links(&near, 2 * n as u32, returns),
            way == Way::Forwards,
        );
        let mut place = vec![0; n + 1];
        for (i, &o) in sequence.iter().enumerate() {
            place[o as usize / 2] = i as u32;
        }
        Self {
            ends,
            returns,
            heat,
            heats: heat.counts(),
            middles: ends
                .iter()
                .map(|[a, b]| (a.midpoint(*b), 0.5 * apart(*a, *b)))
                .collect(),
            points,
            chosen: vec![0; n],
            queue: VecDeque::with_capacity(n + 1),
            queued: vec![false; n + 1],
            sequence,
            place,
            near,
            kicking: false,
            log: Vec::new(),
        }
    }

    /// The strokes in their order from the start, each with whether it is reversed.
    pub(super) fn order(&self) -> Vec<(usize, bool)> {
        let len = self.sequence.len();
        let at = self.place[self.depot() as usize] as usize;
        // The tour leaves the depot from its end at the start: forwards if that is where the ring leaves it.
        let forwards = self.sequence[at] == 2 * self.depot() + 1;
        (1..len)
            .map(|k| {
                let o = if forwards {
                    self.sequence[(at + k) % len]
                } else {
                    self.sequence[(at + len - k) % len] ^ 1
                };
                let s = o as usize / 2;
                (
                    s,
                    if self.returns {
                        self.chosen[s] == 1
                    } else {
                        o % 2 == 1
                    },
                )
            })
            .collect()
    }

    fn depot(&self) -> u32 {
        self.ends.len() as u32
    }

    /// The depot's end that is nowhere.
    fn nowhere(&self) -> End {
        2 * self.depot() + 1
    }

    /// What a link costs: travel, and the heat of the two strokes for each other.
    #[inline]
    fn cost(&self, a: End, b: End) -> f64 {
        let nowhere = self.nowhere();
        if a == nowhere || b == nowhere {
            return 0.0;
        }
        let travel = apart(self.points[a as usize], self.points[b as usize]);
        if self.heats {
            travel + self.heat_between(a / 2, b / 2, 1)
        } else {
            travel
        }
    }

    /// What two strokes pay for each other's heat, with `k` − 1 others between them.
    #[inline]
    fn heat_between(&self, a: u32, b: u32, k: usize) -> f64 {
        let (a, b) = (a as usize, b as usize);
        let (Some((p, half_p)), Some((q, half_q))) = (self.middles.get(a), self.middles.get(b))
        else {
            return 0.0;
        };
        // Most are far apart for certain, and no root is needed to see it.
        let far = self.heat.reach_mm + half_p + half_q;
        if p.distance_squared(*q) >= far * far {
            return 0.0;
        }
        self.heat.between(&self.ends[a], &self.ends[b], k)
    }

    #[inline]
    fn is_entry(&self, end: End) -> bool {
        self.sequence[self.place[end as usize / 2] as usize] == end
    }

    /// The end that an end is linked to.
    #[inline]
    fn mate(&self, end: End) -> End {
        let p = self.place[end as usize / 2] as usize;
        let len = self.sequence.len();
        if self.sequence[p] == end {
            self.sequence[if p == 0 { len - 1 } else { p - 1 }] ^ 1
        } else {
            self.sequence[if p + 1 == len { 0 } else { p + 1 }]
        }
    }

    /// Heat of strokes that have others between them, over all pairs that any of these links separates.
    fn heat_over(&self, links: &[(End, End)]) -> f64 {
        let len = self.sequence.len();
        if !self.heats || len <= 2 * LOOKBACK + 1 {
            return 0.0;
        }
        let mut breaks = [0; 3];
        for (b, &(from, to)) in breaks.iter_mut().zip(links) {
            let entry = if self.is_entry(to) && self.mate(to) == from {
                to
            } else {
                from
            };
            *b = self.place[entry as usize / 2] as usize;
        }
        let breaks = &breaks[..links.len()];
        let depot = self.place[self.depot() as usize] as usize;
        // Whether place `p` is one of the `k` places after place `i`.
        let within = |i: usize, k: usize, p: usize| (1..=k).contains(&ahead(i, p, len));
        let mut sum = 0.0;
        for (m, &b) in breaks.iter().enumerate() {
            for k in 2..=LOOKBACK {
                for before in 1..=k {
                    let i = moved(b, len - before, len);
                    if i == depot
                        || within(i, k, depot)
                        || breaks[..m].iter().any(|&other| within(i, k, other))
                    {
                        continue;
                    }
                    let j = moved(i, k, len);
                    sum += self.heat_between(self.sequence[i] / 2, self.sequence[j] / 2, k);
                }
            }
        }
        sum
    }

    /// Turns places `i..=j` of the ring, or all the others, which is the same ring.
    fn turn(&mut self, i: usize, j: usize) {
        self.log.push(Change::Turned(i as u32, j as u32));
        let len = self.sequence.len();
        let inside = ahead(i, j, len) + 1;
        let (mut a, mut b, count) = if 2 * inside <= len {
            (i, j, inside)
        } else {
            (moved(j, 1, len), moved(i, len - 1, len), len - inside)
        };
        let (sequence, place) = (&mut self.sequence[..], &mut self.place[..]);
        for _ in 0..count.div_ceil(2) {
            let (x, y) = (sequence[a] ^ 1, sequence[b] ^ 1);
            sequence[a] = y;
            sequence[b] = x;
            place[y as usize / 2] = a as u32;
            place[x as usize / 2] = b as u32;
            a = moved(a, 1, len);
            b = moved(b, len - 1, len);
        }
    }

    /// Replaces links `t1`–`t2` and `t3`–`t4` by `t2`–`t3` and `t4`–`t1`: both of `t2`, `t3` are entries, or neither.
    fn turn_between(&mut self, t1: End, t2: End, t3: End, t4: End) {
        let place = |e: End| self.place[e as usize / 2] as usize;
        let (i, j) = if self.is_entry(t2) {
            (place(t2), place(t4))
        } else {
            (place(t1), place(t3))
        };
        self.turn(i, j);
    }

    fn wake(&mut self, end: End) {
        let stroke = end / 2;
        if !self.queued[stroke as usize] {
            self.queued[stroke as usize] = true;
            self.queue.push_back(stroke);
        }
    }

    /// Improves until no exchange of near links makes the tour shorter; what was gained.
    pub(super) fn improve(&mut self) -> f64 {
        for i in 0..self.sequence.len() {
            self.wake(self.sequence[i]);
        }
        self.settle()
    }

    /// What was gained.
    fn settle(&mut self) -> f64 {
        let mut gained = 0.0;
        while let Some(stroke) = self.queue.pop_front() {
            self.queued[stroke as usize] = false;
            while let Some(gain) = self.improve_at(stroke) {
                gained += gain;
                if !self.kicking {
                    self.log.clear();
                }
            }
        }
        gained
    }

    fn improve_at(&mut self, stroke: u32) -> Option<f64> {
        if let Some(gain) = self.choose_other(stroke) {
            return Some(gain);
        }
        for t1 in [2 * stroke, 2 * stroke + 1] {
            if let Some(gain) = self.best_exchange(t1).and_then(|best| self.make(best)) {
                return Some(gain);
            }
        }
        None
    }

    /// With returns: begins a stroke at its other end if that gains.
    fn choose_other(&mut self, stroke: u32) -> Option<f64> {
        if !self.returns || stroke == self.depot() {
            return None;
        }
        let (a, b) = (2 * stroke, 2 * stroke + 1);
        let (before, after) = (self.mate(a), self.mate(b));
        let old = self.cost(before, a) + self.cost(b, after);
        self.switch(stroke);
        let gain = old - self.cost(before, a) - self.cost(b, after);
        if gain > EPSILON {
            for end in [before, a, after] {
                self.wake(end);
            }
            return Some(gain);
        }
        self.switch(stroke);
        self.log.truncate(self.log.len().saturating_sub(2));
        None
    }

    fn switch(&mut self, stroke: u32) {
        let s = stroke as usize;
        self.chosen[s] ^= 1;
        let point = self.ends[s][usize::from(self.chosen[s])];
        self.points[2 * s] = point;
        self.points[2 * s + 1] = point;
        self.log.push(Change::Chosen(stroke));
    }

    fn too_long(&self, p: usize, q: usize) -> bool {
        let apart = p.abs_diff(q);
        apart.min(self.sequence.len() - apart) > REACH
    }

    /// The exchange that begins with the link of `t1` and gains most; heat between strokes that are not neighbours in
    /// the tour is only bounded here, from above.
    fn best_exchange(&self, t1: End) -> Option<Exchange> {
        let t2 = self.mate(t1);
        let forwards = self.is_entry(t2);
        let place = |e: End| self.place[e as usize / 2] as usize;
        let len = self.sequence.len();
        let (p1, p2) = (place(t1), place(t2));
        let given = self.cost(t1, t2) + self.heat_over(&[(t1, t2)]);
        let mut best: Option<Exchange> = None;
        let mut offer = |gain: f64, t: [End; 6], kind: Kind| {
            if gain > best.map_or(EPSILON, |b| b.gain) {
                best = Some(Exchange { gain, t, kind });
            }
        };
        // With returns an end stands for a place, and both sides of the stroke are there.
        let sides = if self.returns { 2 } else { 1 };
        let key = |e: End| {
            if self.returns && e / 2 != self.depot() {
                (e & !1) | End::from(self.chosen[e as usize / 2])
            } else {
                e
            }
        };
        let absent = |e: End| self.returns && self.chosen[e as usize / 2] != (e % 2) as u8;
        for (other, c23) in self.near.of(key(t2)).take(BREADTH[0]) {
            let left = given - c23;
            if left <= EPSILON {
                break;
            }
            if absent(other) {
                continue;
            }
            for side in 0..sides {
                let t3 = other ^ side;
                if t3 == t1 {
                    continue;
                }
                let t4 = self.mate(t3);
                let p3 = place(t3);
                if self.too_long(p1, p3) {
                    continue;
                }
                let valid = self.is_entry(t3) == forwards;
                let left = left + self.cost(t3, t4) + self.heat_over(&[(t3, t4)]);
                if valid {
                    let gain = left - self.cost(t4, t1);
                    offer(gain, [t1, t2, t3, t4, t3, t4], Kind::Turn);
                }
                let p4 = place(t4);
                // The piece between the two links: turned by the first exchange, or closed on itself by it.
                let (from, to) = match (valid, forwards) {
                    (true, true) => (p2, p4),
                    (true, false) => (p4, p2),
                    (false, true) => (p2, p3),
                    (false, false) => (p3, p2),
                };
                let span = ahead(from, to, len);
                for (other, c45) in self.near.of(key(t4)).take(BREADTH[1]) {
                    let left = left - c45;
                    if left <= EPSILON {
                        break;
                    }
                    if absent(other) {
                        continue;
                    }
                    for side in 0..sides {
                        let t5 = other ^ side;
                        if t5 == t1 || t5 == t2 || t5 == t3 {
                            continue;
                        }
                        let p5 = place(t5);
                        if self.too_long(p1, p5) {
                            continue;
                        }
                        let inside = ahead(from, p5, len) <= span;
                        let same = self.is_entry(t5) == self.is_entry(t4);
                        let kind = match (valid, inside) {
                            (true, _) if inside == same => Kind::TurnTwice,
                            (false, true) if same => Kind::TurnBoth,
                            (false, true) => Kind::Swap,
                            _ => continue,
                        };
                        let t6 = self.mate(t5);
                        let gain = left + self.cost(t5, t6) + self.heat_over(&[(t5, t6)])
                            - self.cost(t6, t1);
                        offer(gain, [t1, t2, t3, t4, t5, t6], kind);
                    }
                }
            }
        }
        best
    }

    /// Makes an exchange and wakes its ends. None if, all heat counted, it would not have gained: it is then unmade.
    fn make(&mut self, exchange: Exchange) -> Option<f64> {
        let Exchange { mut gain, t, kind } = exchange;
        let [t1, t2, t3, t4, t5, t6] = t;
        let links = if kind == Kind::Turn { 2 } else { 3 };
        let old = [(t1, t2), (t3, t4), (t5, t6)];
        let new = if kind == Kind::Turn {
            [(t2, t3), (t4, t1), (t4, t1)]
        } else {
            [(t2, t3), (t4, t5), (t6, t1)]
        };
        let mark = self.log.len();
        let before = self.heat_over(&old[..links]);
        if self.heats {
            // The bound counted each link's heat by itself.
            for link in &old[..links] {
                gain -= self.heat_over(std::slice::from_ref(link));
            }
        }
        match kind {
            Kind::Turn => self.turn_between(t1, t2, t3, t4),
            Kind::TurnTwice => {
                self.turn_between(t1, t2, t3, t4);
                self.turn_between(t1, t4, t5, t6);
            }
            Kind::TurnBoth => {
                self.turn_between(t1, t2, t5, t6);
                self.turn_between(t5, t2, t3, t4);
            }
            Kind::Swap => {
                self.turn_between(t1, t2, t4, t3);
                self.turn_between(t1, t3, t5, t6);
                self.turn_between(t5, t3, t2, t4);
            }
        }
        if self.heats {
            gain += before - self.heat_over(&new[..links]);
            if gain <= EPSILON {
                self.undo(mark);
                return None;
            }
        }
        for &end in &t[..2 * links] {
            self.wake(end);
        }
        Some(gain)
    }

    fn undo(&mut self, mark: usize) {
        while self.log.len() > mark {
            match self.log.pop() {
                Some(Change::Turned(i, j)) => self.turn(i as usize, j as usize),
                Some(Change::Chosen(stroke)) => self.switch(stroke),
                None => {}
            }
            self.log.pop();
        }
    }

    /// Three places in their order along the ring, close to each other on the sheet: where a stroke is, and where two short
    /// random walks from it, from near end to near end, arrive. None if they are more than `span` apart along the tour.
    fn near_places(&self, random: &mut Random, stroke: usize, span: usize) -> Option<[usize; 3]> {
        let len = self.sequence.len();
        let first = self.place[stroke] as usize;
        // Places ahead of the one `span` before the first.
        let mut places = [span; 3];
        for other in &mut places[1..] {
            let mut end = self.sequence[first];
            for _ in 0..WALK {
                let near = self.near.list(end);
                let (next, _) = near.get(random.below(near.len()))?;
                end = next ^ (random.below(2) as End);
            }
            let there = self.place[end as usize / 2] as usize;
            *other = moved(ahead(first, there, len), span, len);
        }
        places.sort_unstable();
        let [x, y, z] = places;
        if x == y || y == z || z - x > span {
            return None;
        }
        let from = moved(first, len - span, len);
        Some(places.map(|p| moved(from, p, len)))
    }

    /// Exchanges two neighbouring pieces of the tour between random places that are near on the sheet (the double bridge
    /// with random walks of D. Applegate, W. Cook, A. Rohe 2003), repairs, and keeps what is no longer; so many times.
    pub(super) fn kick(&mut self, times: usize) {
        let len = self.sequence.len();
        if len < 8 {
            return;
        }
        self.kicking = true;
        let mut random = Random(0x9E37_79B9_7F4A_7C15);
        let span = KICK_SPAN.min(len - 2);
        let window = WINDOW.min(len);
        for n in 0..times {
            // How far along the curve this pass has come, in strokes.
            let come = (n * PASSES % times) as f64 / times as f64 * len as f64;
            let stroke = (come as usize + random.below(window)) % len;
            let Some([a, m, e]) = self.near_places(&mut random, stroke, span) else {
                continue;
            };
            let entry = |tour: &Self, p: usize| tour.sequence[p];
            let (t2, t5, t4) = (entry(self, a), entry(self, m), entry(self, e));
            let (t1, t6, t3) = (self.mate(t2), self.mate(t5), self.mate(t4));
            self.log.clear();
            let old = [(t1, t2), (t6, t5), (t3, t4)];
            let new = [(t1, t5), (t3, t2), (t6, t4)];
            let sum = |tour: &Self, links: &[(End, End); 3]| {
                links.iter().map(|&(a, b)| tour.cost(a, b)).sum::<f64>() + tour.heat_over(links)
            };
            let before = sum(self, &old);
            // Between a and m − 1, m and e − 1: the pieces that change sides.
            self.turn_between(t1, t2, t4, t3);
            self.turn_between(t1, t3, t6, t5);
            self.turn_between(t6, t3, t2, t4);
            let lost = sum(self, &new) - before;
            for end in [t1, t2, t3, t4, t5, t6] {
                self.wake(end);
            }
            let gained = self.settle();
            if gained < lost - EPSILON {
                self.undo(0);
            }
        }
        self.kicking = false;
    }
}

/// Knuth's 64-bit linear congruence, high bits: enough to scatter kicks, and the same on every machine.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn below(&mut self, n: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        // A product instead of a remainder: no division.
        (((self.0 >> 32) * n as u64) >> 32) as usize
    }
}
