//! Which logged variables tell a quantity, in which units and signs, and which one is believed.
//!
//! The tables below are the border: degrees, millimetres and the firmware's inverted pitch end
//! here. Each table is in order of belief; the first source that is logged and not constantly zero
//! is taken (an observer that was compiled in but never ran logs zeros).
//!
//! Signs and units: `stabilizer_types.h` and `stabilizer.c` of crazyflie-firmware (attitude in
//! degrees with pitch inverted, compressed state in mm, mm/s and mrad/s), `kalman_core.c` (velocity
//! states in the body frame, quaternion `w x y z`), `quatcompress.h`; the AE483 course's
//! `controller_ae483.c` (metres, radians, body frame).

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::PositionSource;
use super::recording::{Channel, Recording};
use crate::geometry::Attitude;

/// Three variables that tell one vector.
struct Source {
    names: [&'static str; 3],
    /// Turns each value into SI units and our signs.
    factors: [f64; 3],
    kind: PositionSource,
}

const DEG: f64 = std::f64::consts::PI / 180.0;

const fn source(kind: PositionSource, names: [&'static str; 3], factors: [f64; 3]) -> Source {
    Source { names, factors, kind }
}

use PositionSource::{Best, Custom, Estimate, Firmware, Lighthouse, Mocap};

/// World position, m. Lighthouse comes last: its raw fixes stand still between sweeps and drop
/// out, and the estimators have them behind them (reference flight: 5 mm r.m.s. apart).
const POSITION: [Source; 12] = [
    source(Mocap, ["mocap.x", "mocap.y", "mocap.z"], [1.0; 3]),
    source(Mocap, ["ae483log.p_x_mocap", "ae483log.p_y_mocap", "ae483log.p_z_mocap"], [1.0; 3]),
    source(Best, ["x_m", "y_m", "z_m"], [1.0; 3]),
    source(Custom, ["ae483log.o_x", "ae483log.o_y", "ae483log.o_z"], [1.0; 3]),
    source(Custom, ["ae483log.p_x", "ae483log.p_y", "ae483log.p_z"], [1.0; 3]),
    source(Firmware, ["stateEstimate.x", "stateEstimate.y", "stateEstimate.z"], [1.0; 3]),
    source(Firmware, ["stateEstimateZ.x", "stateEstimateZ.y", "stateEstimateZ.z"], [1e-3; 3]),
    source(Firmware, ["kalman.stateX", "kalman.stateY", "kalman.stateZ"], [1.0; 3]),
    source(Mocap, ["locSrv.x", "locSrv.y", "locSrv.z"], [1.0; 3]),
    source(Mocap, ["locSrvZ.x", "locSrvZ.y", "locSrvZ.z"], [1e-3; 3]),
    source(Lighthouse, ["lighthouse.x", "lighthouse.y", "lighthouse.z"], [1.0; 3]),
    source(Lighthouse, ["ae483log.lh_x", "ae483log.lh_y", "ae483log.lh_z"], [1.0; 3]),
];

/// Setpoint, m in the world.
const DESIGN: [Source; 6] = [
    source(Custom, ["ae483log.o_x_des", "ae483log.o_y_des", "ae483log.o_z_des"], [1.0; 3]),
    source(Custom, ["ae483log.p_x_des", "ae483log.p_y_des", "ae483log.p_z_des"], [1.0; 3]),
    source(Firmware, ["ctrltarget.x", "ctrltarget.y", "ctrltarget.z"], [1.0; 3]),
    source(Firmware, ["ctrltargetZ.x", "ctrltargetZ.y", "ctrltargetZ.z"], [1e-3; 3]),
    source(Firmware, ["posCtl.targetX", "posCtl.targetY", "posCtl.targetZ"], [1.0; 3]),
    source(Best, ["x_design_m", "y_design_m", "z_design_m"], [1.0; 3]),
];

/// Yaw, pitch and roll, rad. The firmware's pitch is inverted.
const ATTITUDE: [Source; 6] = [
    source(Mocap, ["mocap.yaw", "mocap.pitch", "mocap.roll"], [1.0; 3]),
    source(Mocap, ["ae483log.psi_mocap", "ae483log.theta_mocap", "ae483log.phi_mocap"], [1.0; 3]),
    source(Best, ["yaw_rad", "pitch_rad", "roll_rad"], [1.0; 3]),
    source(Custom, ["ae483log.psi", "ae483log.theta", "ae483log.phi"], [1.0; 3]),
    source(
        Firmware,
        ["stateEstimate.yaw", "stateEstimate.pitch", "stateEstimate.roll"],
        [DEG, -DEG, DEG],
    ),
    source(Firmware, ["stabilizer.yaw", "stabilizer.pitch", "stabilizer.roll"], [DEG, -DEG, DEG]),
];

/// Quaternions of the attitude in the order w x y z; asked after [`ATTITUDE`].
const QUATERNIONS: [[&str; 4]; 3] = [
    ["qw", "qx", "qy", "qz"],
    ["stateEstimate.qw", "stateEstimate.qx", "stateEstimate.qy", "stateEstimate.qz"],
    ["kalman.q0", "kalman.q1", "kalman.q2", "kalman.q3"],
];

/// The attitude in 32 bits; asked last.
const COMPRESSED_QUATERNION: &str = "stateEstimateZ.quat";

/// Velocity in the body frame, m/s.
const VELOCITY_BODY: [Source; 3] = [
    source(Best, ["vx_body_m_s", "vy_body_m_s", "vz_body_m_s"], [1.0; 3]),
    source(Custom, ["ae483log.v_x", "ae483log.v_y", "ae483log.v_z"], [1.0; 3]),
    source(Firmware, ["kalman.statePX", "kalman.statePY", "kalman.statePZ"], [1.0; 3]),
];

/// Velocity in the world frame, m/s.
const VELOCITY_WORLD: [Source; 3] = [
    source(Best, ["vx_world_m_s", "vy_world_m_s", "vz_world_m_s"], [1.0; 3]),
    source(Firmware, ["stateEstimate.vx", "stateEstimate.vy", "stateEstimate.vz"], [1.0; 3]),
    source(Firmware, ["stateEstimateZ.vx", "stateEstimateZ.vy", "stateEstimateZ.vz"], [1e-3; 3]),
];

/// Angular velocity in the body frame, rad/s.
const RATE: [Source; 4] = [
    source(Best, ["wx_body_rad_s", "wy_body_rad_s", "wz_body_rad_s"], [1.0; 3]),
    source(Custom, ["ae483log.w_x", "ae483log.w_y", "ae483log.w_z"], [1.0; 3]),
    source(Firmware, ["gyro.x", "gyro.y", "gyro.z"], [DEG; 3]),
    source(
        Firmware,
        ["stateEstimateZ.rateRoll", "stateEstimateZ.ratePitch", "stateEstimateZ.rateYaw"],
        [1e-3, -1e-3, 1e-3],
    ),
];

/// Motor commands, 0…65535.
const MOTORS: [[&str; 4]; 4] = [
    ["motor.m1", "motor.m2", "motor.m3", "motor.m4"],
    ["ae483log.m_1", "ae483log.m_2", "ae483log.m_3", "ae483log.m_4"],
    ["pwm.m1_pwm", "pwm.m2_pwm", "pwm.m3_pwm", "pwm.m4_pwm"],
    ["m1", "m2", "m3", "m4"],
];

/// What a recording tells, in SI units, our frames and signs.
#[derive(Debug, Default)]
pub(super) struct Told {
    pub(super) position_m: Option<[Channel; 3]>,
    /// Yaw (without jumps at ±π), pitch, roll.
    pub(super) attitude_rad: Option<[Channel; 3]>,
    pub(super) velocity: Option<(VelocityFrame, [Channel; 3])>,
    pub(super) rate_body_rad_s: Option<[Channel; 3]>,
    pub(super) estimate_m: Option<[Channel; 3]>,
    pub(super) design_m: Option<[Channel; 3]>,
    pub(super) motors: Option<[Channel; 4]>,
    /// Names of the columns behind all these.
    pub(super) used: BTreeSet<String>,
}

/// In which frame a velocity was logged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum VelocityFrame {
    Body,
    World,
}

/// Reads the tables.
pub(super) fn told(recording: &Recording, wanted: PositionSource) -> Told {
    let mut used = BTreeSet::new();
    let mut take = |table: &[Source], kinds: &[PositionSource]| {
        let sources = table.iter().filter(|source| kinds.contains(&source.kind));
        first(recording, sources, &mut used)
    };
    let truth: &[PositionSource] = match wanted {
        Best => &[Best, Mocap, Custom, Firmware, Lighthouse],
        Mocap => &[Mocap],
        Custom => &[Custom],
        Firmware => &[Best, Firmware],
        Lighthouse => &[Lighthouse],
        Estimate => &[Custom, Firmware],
    };
    let anything = &[Best, Mocap, Custom, Firmware, Lighthouse];
    let position_m = take(&POSITION, truth);
    let estimate_m = take(&POSITION, &[Custom, Firmware]);
    let design_m = take(&DESIGN, anything);
    let rate_body_rad_s = take(&RATE, anything);
    let velocity = take(&VELOCITY_BODY, &[Best, Custom])
        .map(|channels| (VelocityFrame::Body, channels))
        .or_else(|| Some((VelocityFrame::World, take(&VELOCITY_WORLD, anything)?)))
        .or_else(|| Some((VelocityFrame::Body, take(&VELOCITY_BODY, &[Firmware])?)));
    // Who tells the position is believed about the attitude as well.
    let believed = |source: &&Source| truth.contains(&source.kind);
    let (believed, others): (Vec<_>, Vec<_>) = ATTITUDE.iter().partition(believed);
    let attitude_rad = first(recording, believed.into_iter().chain(others), &mut used)
        .or_else(|| from_quaternions(recording, &mut used))
        .map(|[yaw, pitch, roll]| [without_jumps(yaw), pitch, without_jumps(roll)]);
    let motors = MOTORS.iter().find_map(|names| quadruple(recording, names, &mut used));
    Told { position_m, attitude_rad, velocity, rate_body_rad_s, estimate_m, design_m, motors, used }
}

/// The first of these sources that is not constantly zero; else the first one that is logged.
fn first<'a>(
    recording: &Recording,
    sources: impl Iterator<Item = &'a Source>,
    used: &mut BTreeSet<String>,
) -> Option<[Channel; 3]> {
    let mut dead = None;
    for source in sources {
        let [a, b, c] = source.names.map(|name| recording.channel(name));
        let (Some(a), Some(b), Some(c)) = (a, b, c) else { continue };
        let channels = [a, b, c];
        if channels.iter().any(|channel| channel.values.iter().any(|value| *value != 0.0)) {
            return Some(turned(source, channels, used));
        }
        dead = dead.or(Some((source, channels)));
    }
    dead.map(|(source, channels)| turned(source, channels, used))
}

fn turned(source: &Source, channels: [Channel; 3], used: &mut BTreeSet<String>) -> [Channel; 3] {
    used.extend(source.names.map(str::to_owned));
    let [a, b, c] = channels;
    let [fa, fb, fc] = source.factors;
    [a.map(|value| value * fa), b.map(|value| value * fb), c.map(|value| value * fc)]
}

fn quadruple(
    recording: &Recording,
    names: &[&str; 4],
    used: &mut BTreeSet<String>,
) -> Option<[Channel; 4]> {
    let channels: Vec<Channel> =
        names.iter().map(|name| recording.channel(name)).collect::<Option<_>>()?;
    used.extend(names.iter().map(|&name| name.to_owned()));
    channels.try_into().ok()
}

fn from_quaternions(recording: &Recording, used: &mut BTreeSet<String>) -> Option<[Channel; 3]> {
    let quadruple = QUATERNIONS.iter().find_map(|names| quadruple(recording, names, used));
    let (time_s, quaternions): (Vec<f64>, Vec<[f64; 4]>) = if let Some([w, x, y, z]) = quadruple {
        let at = |(&time_s, &w): (&f64, &f64)| {
            (time_s, [w, x.held(time_s), y.held(time_s), z.held(time_s)])
        };
        w.time_s.iter().zip(&w.values).map(at).unzip()
    } else {
        let packed = recording.channel(COMPRESSED_QUATERNION)?;
        used.insert(COMPRESSED_QUATERNION.to_owned());
        (packed.time_s, packed.values.into_iter().map(unpacked).collect())
    };
    let valid = |q: &[f64; 4]| q.iter().map(|part| part * part).sum::<f64>() > 1e-6;
    let pairs = time_s.into_iter().zip(quaternions).filter(|(_, q)| valid(q));
    let (time_s, attitudes): (Vec<f64>, Vec<Attitude>) =
        pairs.map(|(time_s, q)| (time_s, attitude_from_quaternion(q))).unzip();
    let channel = |part: fn(&Attitude) -> f64| {
        Channel::new(time_s.clone(), attitudes.iter().map(part).collect())
    };
    let channels = || [channel(|a| a.yaw_rad), channel(|a| a.pitch_rad), channel(|a| a.roll_rad)];
    (!time_s.is_empty()).then(channels)
}

/// The quaternion w x y z behind `quatcompress.h`: two bits say which of x y z w is largest and
/// left out; the others follow with a sign and nine bits of 1/√2 each. Error below 0.1°.
fn unpacked(code: f64) -> [f64; 4] {
    const MASK: u32 = (1 << 9) - 1;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let mut code = code as u32;
    let largest = (code >> 30) as usize;
    let (mut q, mut sum_sq) = ([0.0; 4], 0.0);
    for i in (0..4).rev().filter(|&i| i != largest) {
        let sign = if code >> 9 & 1 == 1 { -1.0 } else { 1.0 };
        q[i] = sign * std::f64::consts::FRAC_1_SQRT_2 * f64::from(code & MASK) / f64::from(MASK);
        sum_sq += q[i] * q[i];
        code >>= 10;
    }
    q[largest] = (1.0 - sum_sq).max(0.0).sqrt();
    [q[3], q[0], q[1], q[2]]
}

/// Yaw, pitch and roll of a quaternion w x y z that need not have unit length.
fn attitude_from_quaternion(q: [f64; 4]) -> Attitude {
    let norm = q.iter().map(|part| part * part).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|part| part / norm);
    Attitude {
        yaw_rad: libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        pitch_rad: libm::asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0)),
        roll_rad: libm::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
    }
}

/// Takes the jumps of 2π out of an angle, so that lines between its samples go the short way.
fn without_jumps(mut channel: Channel) -> Channel {
    let turn = std::f64::consts::TAU;
    let (mut turns, mut last) = (0.0, channel.values[0]);
    for value in &mut channel.values {
        turns -= ((*value - last) / turn).round();
        last = *value;
        *value += turns * turn;
    }
    channel
}

/// A world velocity in the body frame.
pub(super) fn body_from_world(velocity_m_s: Vector3<f64>, attitude: Attitude) -> Vector3<f64> {
    attitude.world_from_body().transpose() * velocity_m_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logs::recording::{Block, Column};

    fn recording(columns: &[(&str, f64)]) -> Recording {
        let column =
            |(name, value): &(&str, f64)| Column { name: (*name).into(), values: vec![*value] };
        let columns = columns.iter().map(column).collect();
        let block = Block { time_s: vec![0.0], columns, ..Block::default() };
        Recording { blocks: vec![block], ..Recording::default() }
    }

    fn values(channels: Option<[Channel; 3]>) -> [f64; 3] {
        channels.unwrap().map(|channel| channel.values[0])
    }

    #[test]
    fn an_observer_of_zeros_is_passed_over() {
        let mut columns = vec![("ae483log.o_x", 0.0), ("ae483log.o_y", 0.0), ("ae483log.o_z", 0.0)];
        assert_eq!(
            values(told(&recording(&columns), Best).position_m),
            [0.0; 3],
            "better than none"
        );
        columns.extend([("stateEstimateZ.x", 500.0), ("stateEstimateZ.y", 1.0)]);
        columns.push(("stateEstimateZ.z", -250.0));
        let told = told(&recording(&columns), Best);
        assert_eq!(values(told.position_m), [0.5, 0.001, -0.25], "millimetres");
        assert!(!told.used.contains("ae483log.o_x"), "the zeros are kept as columns");
    }

    #[test]
    fn degrees_and_the_inverted_pitch_end_here() {
        let names = ["stateEstimate.yaw", "stateEstimate.pitch", "stateEstimate.roll"];
        let log = recording(&[(names[0], 90.0), (names[1], 30.0), (names[2], -180.0)]);
        let pi = std::f64::consts::PI;
        let found = values(told(&log, Best).attitude_rad);
        for (found, wanted) in found.into_iter().zip([pi / 2.0, -pi / 6.0, -pi]) {
            assert!((found - wanted).abs() < 1e-15, "{found} instead of {wanted}");
        }
        let rates =
            ["stateEstimateZ.rateRoll", "stateEstimateZ.ratePitch", "stateEstimateZ.rateYaw"];
        let log = recording(&[(rates[0], 1000.0), (rates[1], 2000.0), (rates[2], 3000.0)]);
        assert_eq!(values(told(&log, Best).rate_body_rad_s), [1.0, -2.0, 3.0]);
    }

    #[test]
    fn a_quaternion_gives_back_its_attitude() {
        let attitude = Attitude { yaw_rad: 2.5, pitch_rad: -0.4, roll_rad: 0.3 };
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(attitude.world_from_body());
        let q = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
        let back = attitude_from_quaternion([q.w, q.i, q.j, q.k].map(|part| part * 1.7));
        let error =
            (back.yaw_rad - 2.5).abs() + (back.pitch_rad + 0.4).abs() + (back.roll_rad - 0.3).abs();
        assert!(error < 1e-12, "{back:?}");
    }

    #[test]
    fn thirty_two_bits_hold_an_attitude() {
        // quatcompress of (x, y, z, w) = (0.1, −0.2, 0.3, 0.927…): w is largest.
        let pack = |part: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "at most 511")]
            let size = (part.abs() / std::f64::consts::FRAC_1_SQRT_2 * 511.0 + 0.5) as u32;
            u32::from(part < 0.0) << 9 | size
        };
        let code = 3 << 30 | pack(0.1) << 20 | pack(-0.2) << 10 | pack(0.3);
        let q = unpacked(f64::from(code));
        let wanted = [0.86_f64.sqrt(), 0.1, -0.2, 0.3];
        for (found, wanted) in q.into_iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-3, "{q:?}");
        }
    }

    #[test]
    fn yaw_goes_the_short_way_over_the_edge() {
        let channel = Channel::new(vec![0.0, 1.0, 2.0], vec![3.0, -3.0, 3.0]);
        let smooth = without_jumps(channel);
        assert!(
            (smooth.linear(0.5, 9.0).unwrap() - std::f64::consts::PI).abs() < 0.01,
            "{smooth:?}"
        );
        assert!((smooth.values[2] - 3.0).abs() < 1e-12, "and back: {smooth:?}");
    }
}
