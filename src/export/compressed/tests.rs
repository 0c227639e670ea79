//! Tests of the compressed trajectory.

use std::f64::consts::FRAC_PI_2;

use super::super::pieces::motion;
use super::super::tests::{assert_same, checked_m, decoded, read, same_thousand, waves};
use super::*;
use noctograph_core::plan::PlanData;
use noctograph_letters::{LetterOptions, write};
use noctograph_plan::{PlanOptions, Setpoint, plan};

fn noor() -> Plan {
    let strokes = write("NOOR", &LetterOptions::default()).unwrap();
    plan(&strokes, &PlanOptions::even()).unwrap()
}

/// Returns the maximum speed and acceleration, sampled every ms.
fn sampled(trajectory: &Compressed) -> [f64; 2] {
    #[expect(clippy::cast_possible_truncation, reason = "a minute")]
    let n = (trajectory.duration_s() * 1000.0) as u32;
    let pieces = trajectory.polynomials();
    (0..n).fold([0.0; 2], |[v, a], ms| {
        let [_, velocity, acceleration] = motion(&pieces, f64::from(ms) / 1000.0);
        [f64::max(v, velocity.norm()), f64::max(a, acceleration.norm())]
    })
}

#[test]
fn the_firmwares_own_evaluator_reads_these_bytes_the_same() {
    let (bytes, rows) = read(include_str!("../recorded/compressed.txt"));
    let trajectory = decoded(&bytes);
    assert_same(&rows, &trajectory.polynomials());
    assert_eq!(trajectory.to_bytes(), bytes);
}

#[test]
fn a_heading_is_the_firmwares_first_yaw_and_constant() {
    let (mut bytes, _) = read(include_str!("../recorded/compressed.txt"));
    bytes[6..8].copy_from_slice(&(-900_i16).to_le_bytes());
    let trajectory = decoded(&bytes);
    assert_eq!((trajectory.yaw, trajectory.to_bytes()), (-900, bytes));
}

#[test]
fn a_heading_that_a_release_flies_is_written_and_one_that_it_misreads_is_refused() {
    let recorded = include_str!("../recorded/heading.txt");
    for line in recorded.lines().filter(|line| !line.starts_with('#')) {
        let numbers: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        let [stored, before_rad, since_rad] = numbers[..] else { panic!("{line}") };
        let yaw_rad = (stored / 10.0).to_radians();
        assert_eq!(f64::from(tenths_of_degrees(yaw_rad)), stored);
        assert!((since_rad - yaw_rad).abs() < 1e-6 && before_rad == 10.0 * stored, "{line}");
        let plan = Plan::made(PlanData { yaw_rad, ..beside().into_data() });
        for release in Release::ALL.iter().copied() {
            let is_right = release.has(&Feature::HEADING);
            let flown_rad = if is_right { since_rad } else { before_rad };
            let is_flown = (flown_rad - yaw_rad).abs() < 1e-6;
            let encoded = Compressed::encode(release, &plan, 0.0001);
            assert_eq!(encoded.is_ok(), is_flown, "{release:?}: {line}");
            assert!(encoded.is_err() || encoded.unwrap().yaw == tenths_of_degrees(yaw_rad));
        }
    }
    let turned = Plan::made(PlanData { yaw_rad: -FRAC_PI_2, ..beside().into_data() });
    let error = Compressed::encode(Release::R2025_12, &turned, 0.0001).unwrap_err();
    let wanted = "vehicle.firmware: found 2025.12, which flies a compressed trajectory with a \
                  heading of -90° (plan.yaw_rad) at -142°, wanted 2026.08 or newer, or a \
                  heading of 0";
    assert_eq!(error.to_string(), wanted);
    let hint = error.hint();
    for way in ["poly4d", "--mode position", "vehicle.firmware", "plan.yaw_rad = 0"] {
        assert!(hint.contains(way), "{hint}");
    }
}

#[test]
fn two_pieces_are_the_bytes_that_were_written_by_hand() {
    let setpoint = |time_s, x, vx, z| Setpoint {
        time_s,
        position_m: Vector3::new(x, 0.0, z),
        velocity_m_s: Vector3::new(vx, 0.0, 0.0),
        acceleration_m_s2: Vector3::zeros(),
        letter: Some(0),
    };
    // From rest, the drone moves 0.1 m to the right at 0.2 m/s. At the end, z jumps by 3 mm.
    let setpoints = vec![
        setpoint(1.0, 0.0, 0.2, 0.5),
        setpoint(1.5, 0.1, 0.0, 0.5),
        setpoint(2.0, 0.1, 0.0, 0.5),
    ];
    let plan = Plan::made(PlanData { setpoints, ..PlanData::default() });
    let trajectory = Compressed::encode(Release::MODELED, &plan, 0.0001).unwrap();
    let bytes = trajectory.to_bytes();
    let want: Vec<u8> = [
        &[0xCE, 0xFF, 0, 0, 0xF4, 1, 0, 0][..], // -50, 0, 500 mm, 0°: where the run-up begins
        &[2, 0xF4, 1, 0xCE, 0xFF, 0xDF, 0xFF, 0, 0], // x cubic, 500 ms: -50, -33, 0 mm
        &[1, 0xF4, 1, 100, 0],                  // x linear, 500 ms, to 100 mm
        &[0, 0xE8, 3],                          // at rest, 1000 ms
        &[0, 0, 0],
    ]
    .concat();
    assert_eq!(bytes, want);
    assert_eq!(decoded(&bytes), trajectory);
    let [position_m, velocity_m_s, _] = motion(&trajectory.polynomials(), 0.75);
    assert!((position_m - Vector3::new(0.05, 0.0, 0.5)).norm() < 1e-12);
    assert!((velocity_m_s - Vector3::new(0.2, 0.0, 0.0)).norm() < 1e-12);
    assert!((trajectory.duration_s() - 2.0).abs() < 1e-12);
}

/// Returns the plan of a drone that takes off at (0.2, 0.3) m and then writes for 1 s.
fn beside() -> Plan {
    let setpoint = |time_s, position_m: [f64; 3], vx, letter| Setpoint {
        time_s,
        position_m: position_m.into(),
        velocity_m_s: Vector3::new(vx, 0.0, 0.0),
        acceleration_m_s2: Vector3::zeros(),
        letter,
    };
    let setpoints = vec![
        setpoint(0.0, [0.2, 0.3, 0.0], 0.0, None),
        setpoint(8.0, [0.0, 0.0, 0.5], 0.2, Some(0)),
        setpoint(8.5, [0.1, 0.0, 0.5], 0.0, Some(0)),
        setpoint(9.0, [0.1, 0.0, 0.5], 0.0, Some(0)),
    ];
    Plan::made(PlanData { setpoints, ..PlanData::default() })
}

/// Returns the flight of [`beside`] for a drone that waits for the given time before it writes.
fn flight_of_beside(waits_s: f64) -> (Timeline, Vec<u8>) {
    let (plan, stretch) = (beside(), Stretch::new(&beside()).unwrap());
    let trajectory = Compressed::encode(Release::MODELED, &plan, 0.0001).unwrap();
    let before_s = stretch.start_s() - waits_s;
    let timeline = Timeline::new(&plan, &stretch, before_s, trajectory.ends_m());
    let bytes = trajectory.flight(&timeline, 0.2).unwrap();
    (timeline, bytes)
}

#[test]
fn a_flight_is_the_bytes_that_were_written_by_hand() {
    let (zero, two_mm, three_mm) = ([0_u8; 2], [200, 0], [0x2C, 1]);
    let (up, below, left) = ([0xF4, 1], [0x9C, 0xFF], [0xCE, 0xFF]);
    let points = |a: [u8; 2], b: [u8; 2]| [a, a, a, b, b, b, b].concat();
    let before = [
        &[200, 0, 0x2C, 1, 0, 0, 0, 0][..], // 200, 300, 0 mm, 0°
        &[0x30, 0xAC, 0x0D],                // z of degree 7, 3500 ms
        &points(zero, up),
        &[0x0F, 0xAC, 0x0D], // x and y, to -50, 0 mm: where the run-up begins
        &points(two_mm, left),
        &points(three_mm, zero),
    ];
    let letters =
        [&[2, 0xF4, 1, 0xCE, 0xFF, 0xDF, 0xFF, 0, 0][..], &[1, 0xF4, 1, 100, 0], &[0, 0xE8, 3]];
    let after = [
        &[0, 0x80, 0x0C][..], // hover of 0.2 s and 3 s
        &[0x30, 0xD0, 7],     // from 500 to -100 mm in 2000 ms
        &points(up, below),
        &[0x10, 0, 0, 0, 0],
    ];
    let want = [before.concat(), letters.concat(), after.concat()].concat();
    assert_eq!(flight_of_beside(0.0).1, want);
    let (_, waiting) = flight_of_beside(70.0);
    let waits = [0, 0xFF, 0xFF, 0, 0x71, 0x11]; // 65 535 and 4 465 ms
    assert_eq!(
        waiting,
        [before.concat(), waits.to_vec(), letters.concat(), after.concat()].concat()
    );
    for (places, mm) in START_BYTES.into_iter().zip([two_mm, three_mm]) {
        places.into_iter().for_each(|place| assert_eq!(want[place..place + 2], mm));
    }
}

#[test]
fn the_firmwares_own_planner_flies_these_bytes_and_has_no_goal_at_their_end() {
    let recorded = include_str!("../recorded/flight.txt");
    let mut lines = recorded.lines().filter(|line| !line.starts_with('#'));
    let (timeline, bytes) = flight_of_beside(0.0);
    let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(lines.next().unwrap(), format!("bytes {hex}"));
    fn flown(segments: &[Segment]) -> Vec<Polynomials> {
        let segments = segments.iter().filter(|segment| segment.duration_s > 0.0);
        segments
            .map(|segment| Polynomials::from_rest_to_rest(segment.ends_m, segment.duration_s))
            .collect()
    }
    let letters = Compressed::encode(Release::MODELED, &beside(), 0.0001).unwrap().polynomials();
    let (before, after) =
        (flown(&timeline.segments_before()), flown(&timeline.segments_without_link(0.2)));
    let all = [before, letters, after].concat();
    let lasts_s: f64 = all.iter().map(|piece| piece.duration_s).sum();
    let mut last_s = 0.0;
    for line in lines {
        let numbers: Vec<f64> = line.split(' ').map_while(|word| word.parse().ok()).collect();
        let [time_s, x, y, z] = numbers[..] else {
            assert_eq!(line, "no goal at 14.25 s");
            break;
        };
        let off_m = (motion(&all, time_s)[0] - Vector3::new(x, y, z)).norm();
        assert!(off_m < 1e-5, "{off_m} m at {time_s} s");
        last_s = time_s;
    }
    assert!((0.0..0.25).contains(&(lasts_s - last_s)), "{last_s} of {lasts_s} s");
}

#[test]
fn a_flight_that_the_memory_does_not_hold_is_refused_with_a_remedy() {
    let (timeline, bytes) = flight_of_beside(0.0);
    let own = Compressed::encode(Release::MODELED, &beside(), 0.0001).unwrap();
    let most = (TRAJECTORY_MEMORY_BYTES - bytes.len()) / 3;
    let with = |n: usize| {
        let hover = Piece { axes: Default::default(), ..own.pieces[own.pieces.len() - 1].clone() };
        let pieces = [own.pieces.clone(), vec![hover; n]].concat();
        Compressed { pieces, ..own }.flight(&timeline, 0.2)
    };
    assert!(with(most).unwrap().len() > TRAJECTORY_MEMORY_BYTES - 3);
    let error = with(most + 1).unwrap_err();
    assert!(error.to_string().contains("with take-off and landing"), "{error}");
    assert!(error.hint().contains("more drones"), "{}", error.hint());
}

#[test]
fn twenty_four_letters_fit_and_of_sixty_it_says_how_many() {
    fn plan_of(word: &str) -> Plan {
        plan(&write(word, &LetterOptions::default()).unwrap(), &PlanOptions::even()).unwrap()
    }
    let word = "NOCTOGRAPH".repeat(6);
    Compressed::encode(Release::MODELED, &plan_of(&word[..24]), 0.002).unwrap();
    let error =
        Compressed::encode(Release::MODELED, &plan_of(&word), 0.002).unwrap_err().to_string();
    let (before, _) = error.split_once(" of 60 letters fit").unwrap();
    let n: usize = before.rsplit(' ').next().unwrap().parse().unwrap();
    let fits = |n: usize| Compressed::encode(Release::MODELED, &plan_of(&word[..n]), 0.002).is_ok();
    assert!(fits(n) && !fits(n + 2), "{error}");
}

proptest::proptest! {
    #![proptest_config(same_thousand())]

    #[test]
    fn random_plans_are_decoded_within_tolerance_range_and_limits(
        plan in waves(),
        tolerance_m in 0.0025..0.01_f64,
    ) {
        let trajectory = Compressed::encode(Release::MODELED, &plan, tolerance_m).unwrap();
        let stretch = Stretch::new(&plan).unwrap();
        let worst_m = checked_m(&stretch, &trajectory.polynomials());
        let [max_m_s, max_m_s2] = stretch.limits();
        // The end of a piece is off by at most half a millisecond.
        let late_m = 0.0005 * max_m_s;
        proptest::prop_assert!(worst_m <= tolerance_m + 0.0005 + late_m, "{} m", worst_m);
        let [v, a] = sampled(&trajectory);
        proptest::prop_assert!(
            v <= 1.05 * max_m_s && a <= 1.05 * max_m_s2,
            "{} of {} m/s, {} of {} m/s²", v, max_m_s, a, max_m_s2
        );
        proptest::prop_assert!(trajectory.pieces.iter().all(|p| p.duration_ms < 65_500));
        let back = decoded(&trajectory.to_bytes());
        proptest::prop_assert_eq!(back, trajectory);
    }
}

#[test]
fn noor_fits_the_memory_six_times_within_two_and_a_half_millimeters() {
    let plan = noor();
    let trajectory = Compressed::encode(Release::MODELED, &plan, 0.002).unwrap();
    let (bytes, stretch) = (trajectory.to_bytes().len(), Stretch::new(&plan).unwrap());
    let worst_m = checked_m(&stretch, &trajectory.polynomials());
    assert!(bytes <= 700 && worst_m <= 0.0025, "{bytes} bytes, {worst_m} m");
    let [max_m_s, max_m_s2] = stretch.limits();
    let [v, a] = sampled(&trajectory);
    assert!(v <= 1.05 * max_m_s && a <= 1.05 * max_m_s2, "{v} m/s, {a} m/s²");
}

#[test]
fn the_deviation_is_that_of_the_bytes_at_each_of_the_drones_milliseconds() {
    let plan = noor();
    let bytes = Compressed::encode(Release::MODELED, &plan, 0.002).unwrap().to_bytes();
    let trajectory = decoded(&bytes);
    let stretch = Stretch::new(&plan).unwrap();
    // De Casteljau's algorithm evaluates the curve independently of `motion`.
    fn on_curve(mut points: Vec<Vector3<f64>>, share: f64) -> Vector3<f64> {
        while points.len() > 1 {
            points = points.windows(2).map(|pair| pair[0].lerp(&pair[1], share)).collect();
        }
        points[0]
    }
    let (mut start_s, mut worst_m) = (0.0, 0.0_f64);
    for (duration_s, points_m) in trajectory.curves() {
        let steps = (1000.0 * duration_s).round();
        for step in (0..).map(f64::from).take_while(|step| *step <= steps) {
            let at_m = on_curve(points_m.to_vec(), step / steps);
            let design_m = stretch.position_m(start_s + duration_s * step / steps);
            worst_m = worst_m.max((at_m - design_m).norm());
        }
        start_s += duration_s;
    }
    let said_m = stretch.worst_m(&trajectory.polynomials());
    assert!((said_m - worst_m).abs() < 1e-9, "{said_m} m said, {worst_m} m by the bytes");
    let checked_m = checked_m(&stretch, &trajectory.polynomials());
    assert!(said_m > checked_m + 5e-5, "{said_m} m, and {checked_m} m where it was checked");
}

#[test]
fn what_does_not_fit_the_form_is_refused() {
    fn refused(change: fn(&mut Setpoint)) -> String {
        let mut plan = noor();
        plan.edit(|plan| plan.setpoints.iter_mut().for_each(change));
        Compressed::encode(Release::MODELED, &plan, 0.002).unwrap_err().to_string()
    }
    assert!(refused(|s| s.position_m.x += 33.0).contains("32.767"));
    assert!(refused(|s| s.letter = None).contains("no letter"));
    assert!(refused(|s| s.time_s *= 2000.0).contains("65.535 s"));
    assert!(refused(|s| s.position_m.z -= 1.0).contains("down to"));
}
