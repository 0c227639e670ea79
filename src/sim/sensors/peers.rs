//! Drones that fly together, and the messages between them.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Vector3};

use super::streams::Clock;
use super::{HeightSensor, PeerOptions, SensorOptions};
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::random::Noise;

/// Drones that fly together, in the order of their plans, from the point of view of one of them.
#[derive(Clone, Debug)]
pub(crate) struct Fleet {
    pub members: Vec<Member>,
    /// Position of this drone in the list.
    pub place: usize,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Member {
    /// Index that selects the drone's noise and its list of anchors.
    pub index: u64,
    /// Believed starting position in m, which is the true position plus an error.
    pub start_m: Vector3<f64>,
}

impl Member {
    /// Creates the member with an index whose true starting position is `start_m`. With
    /// ultra-wideband ranges, the believed starting position has an error.
    pub(crate) fn new(
        sensors: &SensorOptions,
        seed: u64,
        index: u64,
        start_m: Vector3<f64>,
    ) -> Self {
        let error_m =
            if sensors.positioning.is_by_ranges() { sensors.uwb.start_error_m } else { 0.0 };
        let start_m = if error_m > 0.0 {
            start_m + Noise::new(seed, index, "start").normals() * error_m
        } else {
            start_m
        };
        Self { index, start_m }
    }
}

/// Target of a measured distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// Anchor, given by its index.
    Anchor(usize),
    /// Drone, given by its place in the fleet.
    Drone(usize),
    /// Floor, measured by a height sensor.
    Height(HeightSensor),
}

/// Range or height above the floor in a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shared {
    pub time_s: f64,
    pub target: Target,
    pub measured_m: f64,
    pub variance: f64,
}

/// Motion since the start according to inertial sensors. A lost message only causes a delay,
/// because the next message contains the whole motion so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Reckoning {
    pub time_s: f64,
    pub velocity_m_s: Vector3<f64>,
    pub position_m: Vector3<f64>,
}

/// Motion between two instants.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segment {
    pub span_s: f64,
    pub(crate) gained_m_s: Vector3<f64>,
    /// Displacement in m due to acceleration, in addition to that of the initial velocity.
    pub accelerated_m: Vector3<f64>,
    /// Integral of the specific force in the world frame in m/s.
    pub(crate) force_m_s: Vector3<f64>,
}

impl Reckoning {
    /// Returns the motion since `then`, over the time τ. With the position p and the velocity v,
    /// the gained velocity is v − v₀, the displacement due to acceleration is p − p₀ − v₀ τ, and
    /// the integral of the specific force is v − v₀ + g τ, because specific force does not include
    /// gravity.
    pub(crate) fn since(&self, then: &Self) -> Segment {
        let span_s = self.time_s - then.time_s;
        let gained_m_s = self.velocity_m_s - then.velocity_m_s;
        Segment {
            span_s,
            gained_m_s,
            accelerated_m: self.position_m - then.position_m - then.velocity_m_s * span_s,
            force_m_s: gained_m_s + Vector3::z() * (GRAVITY_M_S2 * span_s),
        }
    }
}

/// Message from a drone to all others.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Message {
    /// Place of the sender in the fleet.
    pub from: usize,
    pub motion: Reckoning,
    /// Measurements since the last message.
    pub ranges: Vec<Shared>,
    pub heights: Vec<Shared>,
    /// Estimated position and velocity, and covariance of the position, for `Share::Estimates`.
    pub estimate: (Vector3<f64>, Vector3<f64>, Matrix3<f64>),
}

/// Message on its way between two drones.
#[derive(Debug)]
struct Transit {
    arrives_s: f64,
    /// Place of the receiver in the fleet.
    receiver: usize,
    message: Message,
}

/// Radio channel between the drones, which delays and loses messages.
#[derive(Debug)]
pub(crate) struct Air {
    options: PeerOptions,
    /// Noise that determines losses, indexed by sender and receiver.
    losses: Vec<Vec<Noise>>,
    /// Messages that were sent but have not arrived, in the order of sending.
    in_transit: VecDeque<Transit>,
    clock: Clock,
}

impl Air {
    /// Creates the radio channel between the drones with these indices. The indices select the
    /// random numbers of message loss, so the order of the drones has no effect.
    pub(crate) fn new(options: &PeerOptions, seed: u64, indices: &[u64]) -> Self {
        let losses = indices.iter().map(|from| {
            let receivers = indices.iter();
            receivers.map(|to| Noise::new(seed, *from, &format!("message loss to {to}"))).collect()
        });
        Self {
            options: options.clone(),
            losses: losses.collect(),
            in_transit: VecDeque::new(),
            clock: Clock::new(options.rate_hz),
        }
    }

    /// True if messages are due by `time_s`. The call counts them as sent.
    pub(crate) fn is_due(&mut self, time_s: f64) -> bool {
        self.clock.due(time_s).is_some()
    }

    /// Sends a message to all other drones. Each receiver may lose it.
    pub(crate) fn send(&mut self, message: &Message) {
        let arrives_s = message.motion.time_s + self.options.delay_s;
        for (receiver, loss) in self.losses[message.from].iter_mut().enumerate() {
            if loss.uniform() >= self.options.loss_frac && receiver != message.from {
                let message = message.clone();
                self.in_transit.push_back(Transit { arrives_s, receiver, message });
            }
        }
    }

    /// Removes the next message that has arrived by `time_s`, and returns it with its receiver's
    /// place, or `None` if there is none.
    pub(crate) fn arrived(&mut self, time_s: f64) -> Option<(usize, Message)> {
        let has_arrived = self.in_transit.front()?.arrives_s <= time_s;
        let Transit { receiver, message, .. } =
            has_arrived.then(|| self.in_transit.pop_front()).flatten()?;
        Some((receiver, message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Fleet {
        /// Creates a fleet of a single drone at the origin.
        pub(crate) fn alone(index: u64) -> Self {
            Self { members: vec![Member { index, start_m: Vector3::zeros() }], place: 0 }
        }
    }

    fn message(from: usize, time_s: f64) -> Message {
        Message {
            from,
            motion: Reckoning { time_s, ..Reckoning::default() },
            ranges: Vec::new(),
            heights: Vec::new(),
            estimate: (Vector3::zeros(), Vector3::zeros(), Matrix3::zeros()),
        }
    }

    #[test]
    fn messages_arrive_late_and_as_often_as_stated() {
        let options = PeerOptions { loss_frac: 0.3, delay_s: 0.05, ..PeerOptions::default() };
        let mut air = Air::new(&options, 1, &[0, 1, 2]);
        let mut heard = [0; 3];
        for k in 0..4000_u32 {
            let time_s = f64::from(k) * 0.05;
            assert!(air.is_due(time_s), "twenty a second");
            assert!(!air.is_due(time_s), "and no more");
            air.send(&message(0, time_s));
            assert_eq!(air.arrived(time_s + 0.049), None, "not yet");
            while let Some((to, message)) = air.arrived(time_s + 0.0501) {
                assert_eq!((message.from, message.motion.time_s), (0, time_s));
                heard[to] += 1;
            }
        }
        assert_eq!(heard[0], 0, "not to itself");
        assert!(heard[1..].iter().all(|n| (2700..2900).contains(n)), "{heard:?} of 4000");
        assert_ne!(heard[1], heard[2], "losses are independent");
    }
}
