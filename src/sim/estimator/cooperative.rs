//! Extended Kalman filter on one drone that estimates the states of all drones in its fleet.
//!
//! The nine errors of this drone are those of [`Ekf`](super::ekf::Ekf). For every other drone, the
//! filter estimates the position, the velocity and the tilt of its dead reckoning at the time of
//! its last message. Each message advances these states by the motion that it contains, and
//! corrects them with its ranges and heights. A lost message therefore only delays them. A range
//! between two drones is stored until their messages cover its time. It is compared with the
//! positions at that time, which follow from the present estimates and the received motion. Each
//! drone's filter therefore uses every measurement once, and its covariance includes the correlated
//! errors of the drones.
//!
//! A link whose measurements the gate has rejected five times in a row is accepted again
//! ([`Gate`](crate::kalman::Gate)).
//!
//! Sources: S. I. Roumeliotis, G. A. Bekey, "Distributed multirobot localization", IEEE Trans.
//! Robotics and Automation 18(5), 2002 (one filter for all robots). A. Howard, M. J. Mataric, G. S.
//! Sukhatme 2003, and L. C. Carrillo-Arce et al., IROS 2013 (double counting of estimates).
//!
//! Biases of ranges, of the inertial sensors and of air pressure are not estimated. The noise of
//! the motion between a range and the present, below 1 mm in 0.25 s, is neglected.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Vector3};

use super::Estimator;
use super::delayed::{DelayedState, delayed, interpolated};
use super::ekf::{Ekf, START, Source};
use crate::kalman::{GRAVITY_M_S2, Gate, Inertial, Measurement, Normal, Part, Span, toward};
use crate::options::{CooperativeOptions, ObserverOptions, Share};
use crate::sensors::{
    Fleet, Message, PeerRange, Readings, Reckoning, Segment, SensorOptions, Shared, Target,
};
use crate::vehicle::State;

/// Index of the variance of two-way ranging.
const TWO_WAY: usize = 1;
/// Time in s after which ranges that wait for messages are dropped.
const LONGEST_WAIT_S: f64 = 2.0;
/// Specific force along body z in m/s² above which a drone with its motors off is on the floor.
const ON_FLOOR_M_S2: f64 = 0.8 * GRAVITY_M_S2;
/// Number of messages of each drone that are kept.
const MESSAGES_KEPT: usize = 64;
/// Number of ranges between two other drones that are remembered, so that none is used twice.
const RANGES_KEPT: usize = 256;

#[derive(Debug)]
pub(crate) struct Cooperative {
    /// Filter for all drones, first this drone and then the others in the order of `peers`.
    joint: Ekf,
    /// Attitude, velocity and position from inertial sensors only, which are sent to other drones.
    inertial: Inertial,
    /// Velocity and position from the inertial sensors with the estimated attitude.
    dead_reckoning: Reckoning,
    peers: Vec<Peer>,
    place: usize,
    share: Share,
    force_m_s2: Vector3<f64>,
    ticks: u32,
    gate: Gate<(usize, Target)>,
    /// Measurements for the next message.
    ranges: Vec<Shared>,
    heights: Vec<Shared>,
    /// Ranges to other drones that wait for their messages, with this drone's motion at that time.
    waiting: Vec<(usize, f64, Reckoning)>,
    /// Ranges between two other drones that wait for messages.
    between: Vec<(usize, Shared)>,
    /// Times of used ranges between two other drones, with the indices of the drones.
    used: VecDeque<(f64, usize, usize)>,
}

/// Another drone at the time of its last message.
#[derive(Debug)]
struct Peer {
    place: usize,
    position_m: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
    /// Rotation vector in rad, in the world frame, from its dead-reckoned to its true attitude.
    tilt_rad: Vector3<f64>,
    motions: VecDeque<Reckoning>,
}

/// Returns the initial standard deviations of a drone's position (m), velocity (m/s) and tilt
/// (rad).
pub(super) fn start_sigmas(options: &CooperativeOptions) -> [f64; 3] {
    [options.start_sigma_m, START[1], options.start_tilt_rad]
}

impl Cooperative {
    /// Creates the filter for one drone of a fleet at the start, with all drones level and at rest.
    pub(super) fn new(
        options: &ObserverOptions,
        sensors: &SensorOptions,
        fleet: &Fleet,
        yaw_rad: f64,
    ) -> Self {
        let start_m = fleet.members[fleet.place].start_m;
        let sigmas = start_sigmas(&options.cooperative);
        let normal = Normal::of_drones(fleet.members.len(), sigmas, &[]);
        // Each other drone begins with a message at time zero, before its first real message.
        let others = fleet.members.iter().enumerate().filter(|(place, _)| *place != fleet.place);
        let peers = others.map(|(place, member)| Peer {
            place,
            position_m: member.start_m,
            velocity_m_s: Vector3::zeros(),
            tilt_rad: Vector3::zeros(),
            motions: [Reckoning::default()].into(),
        });
        Self {
            joint: Ekf::of_fleet(&options.ekf, sensors, start_m, yaw_rad, normal),
            inertial: Inertial::level_at(Vector3::zeros(), yaw_rad),
            dead_reckoning: Reckoning::default(),
            peers: peers.collect(),
            place: fleet.place,
            share: options.cooperative.share,
            force_m_s2: Vector3::z() * GRAVITY_M_S2,
            ticks: 0,
            gate: Gate::new(options.ekf.gate_sigmas),
            ranges: Vec::new(),
            heights: Vec::new(),
            waiting: Vec::new(),
            between: Vec::new(),
            used: VecDeque::new(),
        }
    }

    /// Adds the mean errors of the other drones to their states.
    fn settle_peers(&mut self) {
        for (k, peer) in self.peers.iter_mut().enumerate() {
            let [position_m, velocity_m_s, turn_rad] = self.joint.normal.take_errors(k + 1);
            peer.position_m += position_m;
            peer.velocity_m_s += velocity_m_s;
            peer.tilt_rad += turn_rad;
        }
    }

    /// Stores the measurements of this tick for the next message, and ranges to other drones until
    /// their messages arrive.
    fn store(&mut self, readings: &Readings<'_>) {
        let time_s = self.dead_reckoning.time_s;
        let range_variance = self.joint.model.range[TWO_WAY];
        let shared = |target, measured_m, variance| Shared { time_s, target, measured_m, variance };
        for range in readings.ranges {
            let target = Target::Anchor(range.anchor);
            self.ranges.push(shared(target, range.distance_m, range_variance));
        }
        for PeerRange { drone, distance_m } in readings.peer_ranges {
            self.ranges.push(shared(Target::Drone(*drone), *distance_m, range_variance));
            self.waiting.push((*drone, *distance_m, self.dead_reckoning));
        }
        self.waiting.retain(|(.., then)| then.time_s > time_s - LONGEST_WAIT_S);
        // The other drones do not know this drone's tilt, so its ranges to the floor are converted
        // to heights here.
        for &(sensor, measured_m) in readings.heights {
            let height_per_m =
                if sensor.looks_down() { self.inertial.attitude.matrix()[(2, 2)] } else { 1.0 };
            let sigma_m = self.joint.model.sensors.height_sigma_m(sensor, measured_m);
            let variance = (sigma_m * height_per_m) * (sigma_m * height_per_m);
            self.heights.push(shared(Target::Height(sensor), measured_m * height_per_m, variance));
        }
    }

    /// Advances the state of peer `k`, and its covariance, to the time of its message.
    fn carry_peer(&mut self, k: usize, now: Reckoning) {
        let peer = &mut self.peers[k];
        let before = *peer.motions.back().expect("never empty");
        let Segment { span_s, gained_m_s, accelerated_m, force_m_s } = now.since(&before);
        // The estimated tilt rotates the force that the sender has integrated.
        let turned_m_s = peer.tilt_rad.cross(&force_m_s);
        peer.position_m += peer.velocity_m_s * span_s + accelerated_m + turned_m_s * (0.5 * span_s);
        peer.velocity_m_s += gained_m_s + turned_m_s;
        peer.motions.push_back(now);
        if peer.motions.len() > MESSAGES_KEPT {
            peer.motions.pop_front();
        }
        let lever = -force_m_s.cross_matrix() / span_s;
        let span = Span { span_s, lever, turn_rad: Vector3::zeros() };
        self.joint.normal.carry(k + 1, &span, &self.joint.model.density);
    }

    /// Corrects the estimate with a scalar measurement on a link (the drone that measures, and the
    /// target), unless the link's gate rejects it. `value` is the measurement minus its expected
    /// value in m, and `variance` is in m².
    fn correct(&mut self, link: (usize, Target), jacobian: &[Part], value: f64, variance: f64) {
        let measurement = Measurement { jacobian, value, variance };
        self.gate.correct(&mut self.joint.normal, link, &measurement);
    }

    /// Returns the state of peer `k` at a time up to its last message, or `None` if it is unknown,
    /// as in a long gap between messages.
    fn delayed_state_of_peer(&self, k: usize, time_s: f64) -> Option<DelayedState> {
        let peer = &self.peers[k];
        let now = peer.motions.back()?;
        let then = interpolated(&peer.motions, time_s)?;
        Some(delayed(peer.position_m, peer.velocity_m_s, peer.tilt_rad, now, &then))
    }

    /// Corrects the estimate with the heights of peer `k` and its ranges to anchors. Measurements
    /// at times for which the peer's state is unknown are dropped.
    fn correct_peer(&mut self, k: usize, message: &Message) {
        for shared in message.ranges.iter().chain(&message.heights) {
            let Some(then) = self.delayed_state_of_peer(k, shared.time_s) else { continue };
            let (direction, expected_m) = match shared.target {
                Target::Anchor(anchor) => match self.joint.model.anchors_m.get(anchor) {
                    Some(anchor_m) => toward(&(then.position_m - anchor_m)),
                    None => continue,
                },
                Target::Height(_) => (Vector3::z(), then.position_m.z),
                Target::Drone(_) => continue,
            };
            let jacobian = then.jacobian(k + 1, direction, None);
            let link = (message.from, shared.target);
            self.correct(link, &jacobian, shared.measured_m - expected_m, shared.variance);
        }
    }

    /// Corrects the estimate with stored ranges to peer `k`, up to the time of its last message.
    fn correct_waiting(&mut self, k: usize, message: &Message) {
        let waiting = std::mem::take(&mut self.waiting);
        for (place, distance_m, then) in waiting {
            // Ranges that are later than the peer's motion remain stored until its next message.
            if place != message.from || then.time_s > message.motion.time_s {
                self.waiting.push((place, distance_m, then));
                continue;
            }
            let Inertial { position_m, velocity_m_s, world_from_body, .. } = self.joint.motion;
            let no_tilt = Vector3::zeros();
            let here = delayed(position_m, velocity_m_s, no_tilt, &self.dead_reckoning, &then);
            let link = (self.place, Target::Drone(place));
            let variance = self.joint.model.range[TWO_WAY];
            if self.share == Share::Estimates {
                // The peer is assumed to be at the position that it estimates, and the variance of
                // that estimate is added to the range's.
                let (peer_m, peer_m_s, covariance) = message.estimate;
                let there_m = peer_m - peer_m_s * (message.motion.time_s - then.time_s);
                let (direction, expected_m) = toward(&(here.position_m - there_m));
                let peer_variance = direction.dot(&(covariance * direction));
                let jacobian = here.jacobian(0, direction, Some(&world_from_body));
                self.correct(link, &jacobian, distance_m - expected_m, variance + peer_variance);
            } else if let Some(there) = self.delayed_state_of_peer(k, then.time_s) {
                let (direction, expected_m) = toward(&(here.position_m - there.position_m));
                let jacobian = [
                    here.jacobian(0, direction, Some(&world_from_body)),
                    there.jacobian(k + 1, -direction, None),
                ];
                self.correct(link, jacobian.as_flattened(), distance_m - expected_m, variance);
            }
        }
    }

    /// Corrects the estimate with ranges between two other drones, once the messages of both cover
    /// the time of the range.
    fn correct_between(&mut self, message: &Message) {
        let others = message
            .ranges
            .iter()
            .filter(|range| matches!(range.target, Target::Drone(other) if other != self.place));
        self.between.extend(others.map(|range| (message.from, *range)));
        for (from, range) in std::mem::take(&mut self.between) {
            let Target::Drone(other) = range.target else { continue };
            let [Some(i), Some(j)] = [from, other].map(|place| self.index_of(place)) else {
                continue;
            };
            // Both drones report the range, which is used only once, or dropped if it is too old.
            let (first, second) = (from.min(other), from.max(other));
            let key = (range.time_s, first, second);
            if self.used.contains(&key) || range.time_s < message.motion.time_s - LONGEST_WAIT_S {
                continue;
            }
            if range.time_s > self.last_s(i).min(self.last_s(j)) {
                self.between.push((from, range));
                continue;
            }
            self.used.push_back(key);
            if self.used.len() > RANGES_KEPT {
                self.used.pop_front();
            }
            // Both positions at the time of the range are functions of the present errors.
            let [one, two] = [i, j].map(|k| self.delayed_state_of_peer(k, range.time_s));
            let (Some(one), Some(two)) = (one, two) else { continue };
            let (direction, expected_m) = toward(&(one.position_m - two.position_m));
            let jacobian =
                [one.jacobian(i + 1, direction, None), two.jacobian(j + 1, -direction, None)];
            let link = (first, Target::Drone(second));
            let variance = self.joint.model.range[TWO_WAY];
            self.correct(link, jacobian.as_flattened(), range.measured_m - expected_m, variance);
        }
    }

    /// Returns a drone's index among the peers, or `None` for this drone.
    fn index_of(&self, place: usize) -> Option<usize> {
        self.peers.iter().position(|peer| peer.place == place)
    }

    /// Returns the time of the last message of a peer in s.
    fn last_s(&self, k: usize) -> f64 {
        self.peers[k].motions.back().map_or(0.0, |last| last.time_s)
    }

    /// Sets the velocity of this drone to zero if it is on the floor, where its accelerometer
    /// measures its weight. The function must only be called while the motors are off. Because the
    /// accelerometer does not measure the impact of the landing, all estimates of this drone in the
    /// fleet would otherwise continue to fall.
    pub(crate) fn rest(&mut self) {
        if !self.peers.is_empty() && self.force_m_s2.z > ON_FLOOR_M_S2 {
            // The other two velocities keep their differences from the joint filter's velocity.
            let stopped_m_s = std::mem::take(&mut self.joint.motion.velocity_m_s);
            self.inertial.velocity_m_s -= stopped_m_s;
            self.dead_reckoning.velocity_m_s -= stopped_m_s;
        }
    }

    /// Returns the drone's next message to the fleet, or `None` if drones exchange nothing. The
    /// measurements since the last message are moved into it.
    pub(crate) fn message(&mut self) -> Option<Message> {
        if self.share == Share::Nothing {
            return None;
        }
        Some(Message {
            from: self.place,
            motion: Reckoning {
                time_s: self.dead_reckoning.time_s,
                velocity_m_s: self.inertial.velocity_m_s,
                position_m: self.inertial.position_m,
            },
            ranges: std::mem::take(&mut self.ranges),
            heights: std::mem::take(&mut self.heights),
            estimate: (
                self.joint.motion.position_m,
                self.joint.motion.velocity_m_s,
                self.joint.normal.block(0, 0),
            ),
        })
    }

    /// Corrects the estimate with a message and with the stored ranges to its sender. If drones
    /// exchange measurements, the sender's state is first advanced to the message's time. A message
    /// that is not newer than the sender's last one is ignored.
    pub(crate) fn receive(&mut self, message: &Message) {
        let Some(k) = self.index_of(message.from) else { return };
        if message.motion.time_s <= self.last_s(k) {
            return;
        }
        // This drone's covariance is advanced to the present first, followed by the sender's state
        // to its message. Only then can ranges between them be compared.
        self.joint.carry(&self.force_m_s2);
        if self.share == Share::Measurements {
            self.carry_peer(k, message.motion);
            self.correct_peer(k, message);
            self.correct_between(message);
        }
        self.correct_waiting(k, message);
        let Ekf { motion, normal, .. } = &mut self.joint;
        motion.settle(normal, 0);
        self.settle_peers();
    }
}

impl Estimator for Cooperative {
    /// Updates the joint filter and both dead reckonings, and stores the measurements for the next
    /// message.
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64) {
        let force_m_s2 = readings.specific_force_m_s2;
        self.force_m_s2 = force_m_s2;
        let Self { joint, gate, place, .. } = self;
        let acceleration = joint.advance(readings, tick_s, |normal, source, measurement| {
            match source {
                Source::To(target) => {
                    gate.correct(normal, (*place, target), measurement);
                }
                // These measurements belong to no link to an anchor or a drone, and are not gated.
                Source::Sweep { .. } | Source::Position => {
                    normal.correct(measurement, |_| true);
                }
            }
        });
        self.settle_peers();
        // Messages contain the dead reckoning from inertial sensors only. The dead reckoning with
        // the estimated attitude gives past positions of this drone.
        self.inertial.predict(&readings.rate_rad_s, &force_m_s2, tick_s);
        let dead_reckoning = &mut self.dead_reckoning;
        dead_reckoning.time_s = f64::from(self.ticks) * tick_s;
        dead_reckoning.position_m +=
            (dead_reckoning.velocity_m_s + acceleration * (0.5 * tick_s)) * tick_s;
        dead_reckoning.velocity_m_s += acceleration * tick_s;
        self.ticks += 1;
        if !self.peers.is_empty() {
            self.store(readings);
        }
    }

    fn state(&self) -> State {
        self.joint.state()
    }

    fn covariance_m2(&self) -> Option<Matrix3<f64>> {
        self.joint.covariance_m2()
    }

    fn fleet_filter(&mut self) -> Option<&mut Cooperative> {
        Some(self)
    }
}
