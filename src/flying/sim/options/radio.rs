//! Settings of the radio link.

use noctograph_core::settings::settings;

settings! {
    /// The radio that carries setpoints and light commands. By default they arrive at once.
    ///
    /// A Crazyradio serves its drones in turn, each with its newest setpoint: 0.7 ms for a packet
    /// and its answer, and 2.5 ms to switch to another drone's address (`crazyradio2-firmware`
    /// issue 9). What is not answered is sent again in the next turn.
    ///
    /// Loss: 1 to 4 % with cflib (`crazyflie_ros` issue 73). Outages: when other senders fill the
    /// band; the log of the reference flight has gaps of up to 0.73 s in 59 s.
    pub struct RadioOptions {
        /// Drones that share one radio; 0: every command arrives at once.
        drones: u32 = 0, in 0.0..=64.0;
        /// Share of packets that get no answer.
        loss_frac: f64 = 0.02, in 0.0..=1.0, for "radio.drones";
        /// Mean time from one outage to the next, exponential; 0: none.
        outage_every_s: f64 = 0.0, in 0.0..=1e5, for "radio.drones";
        /// Mean duration of an outage, exponential.
        outage_s: f64 = 0.1, in 0.0..=1e3, for "radio.outage_every_s";
        /// What the radio carries.
        setpoints: Setpoints = Setpoints::Streamed, for "radio.drones";
    }

    /// Where setpoints come from.
    pub enum Setpoints {
        /// From the host, one after the other; without them the firmware levels the drone out after
        /// 0.5 s and stops its motors after 2 s.
        "streamed" => Streamed,
        /// From a trajectory on board: only light commands are late.
        "on-board" => OnBoard,
    }
}
