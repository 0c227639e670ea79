//! Crazyflie firmware releases, and their differences that affect exports, simulator and logs.
//!
//! The differences come from the firmware's history from 2023.11 to [`super::FIRMWARE_REVISION`].
//! `docs/fly.md` lists the differences that are not in [`Feature::ALL`].

use super::SLOW_CLOCK;
use crate::settings::settings;

settings! {
    /// Releases of the Crazyflie's firmware, beginning with the oldest that can fly exported
    /// scripts. Each release includes its patches.
    pub enum Release {
        /// Flies like 2024.10, but supports neither the Brushless nor Lee's controller.
        "2023.11" => R2023_11,
        /// Adds the Brushless and Lee's controller.
        "2024.10" => R2024_10,
        /// Flies like 2024.10.
        "2025.02" => R2025_02,
        /// Flies like 2024.10.
        "2025.09" => R2025_09,
        /// Adds the color LED deck.
        "2025.12" => R2025_12,
        /// Keeps the controller's integrals when the host falls silent, as all earlier releases do.
        "2026.04" => R2026_04,
        /// Resets all loops of `pid` when the kind of setpoint changes, which happens when the
        /// drone levels out in a radio outage, when the setpoints return, and when the drone lands
        /// after full states. The heading of a compressed trajectory is correct. The clock is slow
        /// by 1 in 85, as in all earlier releases.
        "2026.08" => R2026_08,
        /// Flies like 2026.08, with a correct clock.
        "after-2026.08" => After2026_08,
    }
}

/// Firmware feature that earlier releases lack.
#[derive(Debug)]
pub struct Feature {
    /// Name of the feature.
    pub what: &'static str,
    /// First release with the feature.
    pub since: Release,
    /// Behavior of earlier releases.
    pub before: &'static str,
    /// Firmware file with the feature, followed by a commit or pull request.
    pub source: &'static str,
    /// Parts of this program that depend on the feature.
    pub here: &'static str,
}

impl Feature {
    /// Reset of the PID loops when the kind of setpoint changes.
    pub const RESET: Self = Self {
        what: "all PID loops are reset when the kind of setpoint changes",
        since: Release::R2026_08,
        before: "the loops keep their integral terms",
        source: "`controller_pid.c`; #1645, 5d287434",
        here: "simulator: outages, and landing after full states",
    };
    /// Heading of compressed trajectories, which the firmware stores in tenths of a degree.
    pub const HEADING: Self = Self {
        what: "the heading of a compressed trajectory is read in tenths of a degree",
        since: Release::R2026_08,
        before: "the stored number is multiplied by ten and taken as radians: -90° becomes -142°; 0 \
                 stays 0",
        source: "`pptraj_compressed.c`; #1659, #1661, 7ce8c762",
        here: "`export`, `preview --as-exported compressed` and the script refuse any heading except 0",
    };
    /// Conversion of logged values to half precision (FP16).
    pub const HALF_PRECISION: Self = Self {
        what: "half-precision log values (FP16) keep the carry of their rounding",
        since: Release::R2026_08,
        before: "values that round up to 0.5, 2, 8, 32 or another 2·4ⁿ are logged as half of this value",
        source: "`num.c`, `log.c`; #1647, 887ce819",
        here: "`import`: samples that are half of both neighbors are doubled, with a warning",
    };
    /// Microsecond clock, which timestamps logs on the card and times onboard trajectories.
    pub const CLOCK: Self = Self {
        what: "the clock of trajectories and µSD logs is correct",
        since: Release::After2026_08,
        before: "the clock runs at 84/85 of true time, because a timer counts to 85 instead of 84",
        source: "`usec_time.c`; #1684, bb58cadf, not merged yet",
        here: "simulator, scripts, `import`",
    };
    /// Color LED deck.
    pub const COLOR_LED: Self = Self {
        what: "the color LED deck",
        since: Release::R2025_12,
        before: "no driver",
        source: "`color_led_deck.c`; d4b1061b, 4512edd6",
        here: "exports that use the deck are refused",
    };
    /// Lee's controller.
    pub const LEE: Self = Self {
        what: "Lee's controller, number 5",
        since: Release::R2024_10,
        before: "number 5 is unassigned or a custom controller, and PID remains active",
        source: "`controller_lee.c`; 1f167ea0, 61b14665",
        here: "exports that select the controller are refused",
    };
    /// Crazyflie 2.1 Brushless.
    pub const BRUSHLESS: Self = Self {
        what: "the Crazyflie 2.1 Brushless",
        since: Release::R2024_10,
        before: "no separate gains and limits",
        source: "`platform_defaults_cf21bl.h`; 35f5092a",
        here: "exports for this drone are refused",
    };

    /// All features on which this program depends, newest first.
    pub const ALL: [Self; 7] = [
        Self::CLOCK,
        Self::RESET,
        Self::HEADING,
        Self::HALF_PRECISION,
        Self::COLOR_LED,
        Self::LEE,
        Self::BRUSHLESS,
    ];

    /// Returns the last release that lacks the feature. No feature dates from the oldest release.
    pub fn last_without(&self) -> Release {
        Release::ALL[(self.since as usize).saturating_sub(1)]
    }

    /// Returns all features as a Markdown table for `docs/fly.md`.
    pub fn table() -> String {
        let row = |Self { what, since, before, source, here }: &Self| {
            format!("| {} | {what} | {before} | {source} | {here} |\n", since.name())
        };
        let head = "| since | what | before | source | here |\n|---|---|---|---|---|\n";
        head.to_owned() + &Self::ALL.iter().map(row).collect::<String>()
    }
}

impl Release {
    /// Oldest release that can fly exported scripts, with every log variable that they read.
    pub const OLDEST: Self = Self::R2023_11;
    /// Release that contains [`super::FIRMWARE_REVISION`].
    pub const MODELED: Self = Self::R2026_08;

    /// Returns the release that flies like a version such as `2025.12.1`, which is the newest
    /// release up to that version, or otherwise the oldest release. Returns `None` for a custom
    /// build, whose version has a different format.
    pub fn parse(version: &str) -> Option<Self> {
        let firmware = year_and_month(version)?;
        let mut releases = Self::ALL.iter();
        let not_newer =
            releases.rfind(|r| year_and_month(r.name()).is_some_and(|release| release <= firmware));
        Some(match not_newer {
            // The last release has no number yet, so it stands for all versions after 2026.08.
            Some(Self::R2026_08) if firmware > (2026, 8) => Self::After2026_08,
            Some(release) => *release,
            None => Self::OLDEST,
        })
    }

    /// Returns the release with this name, which may have a patch number, or `None` if it is
    /// unknown.
    pub fn named(name: &str) -> Option<Self> {
        Self::parse(name).filter(|release| year_and_month(release.name()) == year_and_month(name))
    }

    /// True if the release has a feature.
    pub fn has(self, feature: &Feature) -> bool {
        self as usize >= feature.since as usize
    }

    /// True if both releases have the same features.
    pub fn is_like(self, other: Self) -> bool {
        Feature::ALL.iter().all(|feature| self.has(feature) == other.has(feature))
    }

    /// Returns the rate of the clock for card logs and onboard trajectories, relative to true time.
    pub fn clock(self) -> f64 {
        if self.has(&Feature::CLOCK) { 1.0 } else { SLOW_CLOCK }
    }
}

/// Parses the year and the month of a version such as `2025.12` or `2025.12.1`, or returns `None`
/// for another form.
fn year_and_month(name: &str) -> Option<(u32, u32)> {
    let parts: Vec<&str> = name.splitn(3, '.').collect();
    let (year, month) = (parts[0], parts.get(1)?);
    let are_digits =
        parts.iter().all(|part| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit()));
    let is_month = are_digits && (year.len(), month.len()) == (4, 2);
    is_month.then_some((year.parse().ok()?, month.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_firmware_is_of_the_release_that_flies_as_it_does() {
        for (firmware, release) in [
            ("2022.01", Some(Release::R2023_11)),
            ("2023.11", Some(Release::R2023_11)),
            ("2024.10.2", Some(Release::R2024_10)),
            ("2025.12.1", Some(Release::R2025_12)),
            ("2026.06", Some(Release::R2026_04)),
            ("2026.08", Some(Release::R2026_08)),
            ("2026.08.1", Some(Release::R2026_08)),
            ("2026.10", Some(Release::After2026_08)),
            ("2027.01", Some(Release::After2026_08)),
            ("2026.08 +12", None),
            ("2a18fc29", None),
            ("2026.8", None),
            ("2026.08.", None),
            ("2026.08.1.2", None),
            ("after-2026.08", None),
            ("", None),
        ] {
            assert_eq!(Release::parse(firmware), release, "{firmware}");
        }
        assert_eq!(Release::named("2025.12.1"), Some(Release::R2025_12));
        for unknown in ["2022.01", "2026.06", "2027.01", "2025.12 +3", "2025"] {
            assert_eq!(Release::named(unknown), None, "{unknown} is no name of a scene");
        }
    }

    #[test]
    fn each_release_has_what_the_table_says_and_those_before_have_not() {
        let n_of =
            |release: &Release| Feature::ALL.iter().filter(|feature| release.has(feature)).count();
        let counts: Vec<usize> = Release::ALL.iter().map(n_of).collect();
        assert_eq!(counts, [0, 2, 2, 2, 3, 3, 6, 7], "of {:?}", Release::ALL);
        for feature in &Feature::ALL {
            let last = feature.last_without();
            assert!(!last.has(feature) && feature.since.has(feature), "{feature:?}");
        }
        assert_eq!(Feature::CLOCK.last_without(), Release::R2026_08);
        assert_eq!(Feature::HEADING.last_without(), Release::R2026_04);
        assert!(Release::R2026_08.clock() < 0.99 && Release::After2026_08.clock() == 1.0);
        assert!(Release::R2025_12.is_like(Release::R2026_04));
        assert!(!Release::R2025_09.is_like(Release::R2026_04), "no color LED deck");
        let since = Feature::ALL.map(|feature| feature.since as usize);
        assert!(since.is_sorted_by(|a, b| a >= b), "the newest first: {since:?}");
    }
}
