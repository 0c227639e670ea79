//! Broken logs must give errors or warnings, never a panic.

use proptest::prelude::*;

use super::*;

/// The formats of one short log, for breaking.
fn valid_logs() -> Vec<Vec<u8>> {
    let mut json =
        format!("{{\"drone\": {{{}}}, \"mocap\": {{}}}}", json_variables(1.0)).into_bytes();
    json.truncate(30_000);
    let ranges = b"i,timestamp,ranging.distance0\n0,2023-05-04 12:00:00,1\n1,12:00:01,2\n".to_vec();
    let mut usd = usd_log(2, 1.0);
    usd.truncate(3_000);
    let mut usd1 = usd_log(1, 1.0);
    usd1.truncate(3_000);
    let csv = cfclient_block(0).as_bytes()[..4_000].to_vec();
    let mocap = br#"{"drone": {"stateEstimate.x": {"time": [1, 2, 3], "data": [1, 2, 3]}},
        "mocap": {"time": [5, 6, 7], "x": [1, NaN, 3], "y": [1, 2, 3], "z": [0, 0, 1]}}"#;
    let plain = b"t,x,y,z,yaw,r\n0,1,2,3,4,5\n0.1,2,3,4,5,6\n".to_vec();
    vec![json, ranges, usd, usd1, csv, mocap.to_vec(), plain]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn any_bytes_are_a_flight_or_an_error(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = parse(&bytes, "fuzz", &ImportOptions::default()).map(|flight| flight.samples.len());
    }

    #[test]
    fn a_mutated_log_is_a_flight_or_an_error(
        which in 0..7_usize,
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut log = valid_logs().swap_remove(which);
        for (place, byte) in changes {
            let at = place.index(log.len());
            log[at] = byte;
        }
        for damaged in [Damaged::Refuse, Damaged::Recover] {
            let options = ImportOptions { damaged, sample_rate_hz: 10.0, ..Default::default() };
            let _ = parse(&log, "fuzz", &options).map(|flight| flight.samples.len());
        }
        log.truncate(cut.index(log.len()));
        if let Ok(flight) = parse(&log, "fuzz", &ImportOptions::default()) {
            prop_assert!(flight.samples.windows(2).all(|p| p[0].time_s <= p[1].time_s), "time rises");
            let finite = |s: &FlightSample| s.position_m.iter().all(|value| value.is_finite());
            prop_assert!(flight.samples.iter().all(finite), "numbers only");
        }
    }
}
