"""What stages find, as dictionaries: made by tests/it/answer_types.rs of the types in Rust."""

from __future__ import annotations

from typing import Any, Literal, TypedDict


class Advice(TypedDict):
    """A sentence of advice."""

    kind: CauseKind
    """The kind of fault that the advice removes."""
    text: str
    """A sentence for people."""
    gain: float | None
    """Gain in readability, 0 to 1, when the photo is read without any fault of the kind. `None` if these cannot be removed."""


class Calibration(TypedDict):
    """Logistic regression of the readability: `1 / (1 + exp(−(constant + mean_log_odds · m + rival · r + spelling · s)))`. `m` is the mean log-odds of the letters, and `r` the log-odds of the word against its rival. `s` says how usual the spelling is: the mean over its letters of ln p, each after the four before it, plus 2.2, times 1 − m / 8 for m from 0 to 8."""

    reader: str
    """Readers whose reading it predicts."""
    constant: float
    """Constant of the regression."""
    mean_log_odds: float
    """Weight of the letters' mean log-odds, each within −9 and 8."""
    rival: float
    """Weight of the log-odds of the word against the likeliest other one, within ±9."""
    spelling: float
    """Weight of the spelling, `s` above."""


class Candidate(TypedDict):
    """One point of the search with its figures."""

    number: int
    """Its number, in the order of the search."""
    settings: dict[str, Any]
    """The scene's values of the knobs' keys, in their own units."""
    n_flights: int
    """Number of flights behind its figures."""
    merit: float
    """Mean merit."""
    legibility: float
    """Mean probability of being read."""
    legible: Estimate
    """Fraction of flights whose photo is legible."""
    duration_s: float | None
    """Mean time of a flight. `None` if every drone was lost."""
    broken: float
    """Sum of the excesses over its limits, each as a fraction of the limit. 0 if it keeps all limits."""
    given_up: bool
    """True if it was given up after half of its flights."""


class Cause(TypedDict):
    """A fault in the photo, and the gain from mending it."""

    kind: CauseKind
    """Kind of the fault."""
    letter: int | None
    """Index of the letter, from 0, or `None` if the fault concerns the whole word."""
    length_mm: float | None
    """Length, distance or width in the plane of the word."""
    at_m: list[float] | None
    """Middle of the fault in the plane of the word, to the right and up."""
    missing: MissingRun | None
    """The part of a stroke that is missing."""
    lamp_delay_s: float | None
    """Delay of the lamp, if light leads from stroke to stroke and the speed is known."""
    log_gap_s: list[float] | None
    """Start and end of the log gap in which a part of a stroke is missing."""
    reads_as: str | None
    """The letter that this one looks like, for a fault of design."""
    gain: float | None
    """Gain in the letter's probability, −1 to 1, when the photo is read without the fault. `None` if the fault cannot be removed."""


CauseKind = Literal[
    "missing_run",
    "log_gap",
    "lit_transit",
    "streak",
    "dwell_blob",
    "overlap",
    "other_stray",
    "shifted",
    "glow",
    "few_pixels",
    "dim",
    "design",
    "off_path",
]
"""Kind of a fault."""


class Estimate(TypedDict):
    """A figure and its confidence interval at a stated level."""

    value: float
    """The figure of all values."""
    low: float
    """Lower end."""
    high: float
    """Upper end."""


class Flown(TypedDict, total=False):
    """Figures of a flight."""

    contour_m: float
    """Mean distance from the path in the word's plane."""
    lag_s: float
    """Lag behind the design."""
    rmse_x_m: float
    """Root mean square error against the design along x."""
    rmse_y_m: float
    """Along y."""
    rmse_z_m: float
    """Along z."""
    drift_y_m: float
    """Largest distance from the word's plane."""
    tilt_rad: float
    """Largest tilt: roll or pitch."""
    saturated_frac: float
    """Fraction of the time in which a motor is saturated."""
    duration_s: float
    """Duration of the whole flight."""
    energy_j: float
    """Energy of the whole flight: current of the thrust and of the electronics at the open-circuit voltage."""


class LetterVerdict(TypedDict):
    """The verdict on one letter."""

    expected: str
    """The expected letter."""
    best: str | None
    """The likeliest letter, or `None` if light that is no letter is likelier."""
    p: float | None
    """Probability of the expected letter in the choice among all, the other letters being right, 0 to 1, or `None` for punctuation, which is not judged."""
    no_letter: float | None
    """Probability of no letter at all, 0 to 1, or `None` for punctuation."""
    rivals: list[Rival]
    """The three likeliest other letters, the likeliest first."""
    shift_m: list[float] | None
    """Offset of the letter from its position in the word, to the right and up. This and the next four fields are `None` if not computed."""
    recall: float | None
    """Fraction of the intended strokes, moved onto their light, with light within 0.1 cap heights."""
    precision: float | None
    """Fraction of the light's lines within 0.1 cap heights of an intended stroke."""
    missing_mm: float | None
    """Length of the intended strokes without light."""
    stray_mm: float | None
    """Length of the light's lines away from the intended strokes."""
    confusion: list[Rival]
    """Probabilities of all letters in the choice, the likeliest first, down to a thousandth."""


class MissingRun(TypedDict):
    """A part of an intended stroke without light."""

    stroke: int
    """Index of the run of the pen within the letter."""
    from_mm: float
    """Start of the missing part along the run."""
    to_mm: float
    """End of the missing part along the run."""


class Outcome(Flown, TypedDict):
    """The result of one trial: a line of a `Store`."""

    read: str
    """The letters that were read."""
    all_read: bool
    """True if every letter was read as intended."""
    legible: bool
    """True if the word counts as legible."""
    probability: float
    """Probability that a viewer reads the word and no other at first sight, 0 to 1: `read_probability`."""
    log_odds: float
    """Its log-odds, −10 to 10, which still change near 0 and 1."""
    similarity: float
    """Mean probability of the intended letters, 0 to 1. It changes even while the word is illegible."""
    lost: str | None
    """How a drone was lost. `None` if none was."""


class Placement(TypedDict):
    """Placement of the word against the intended one."""

    shift_m: list[float]
    """Shift to the right and up, in the plane of the word."""
    scale: float
    """Ratio of the size to the intended size."""
    rotation_rad: float
    """Rotation about the middle of the word, counterclockwise."""


Reason = Literal[
    "not_in_photo",
    "no_light",
    "too_small",
    "out_of_range",
    "other_length",
    "misread",
    "unsure",
]
"""Why a word is not legible."""


class Rival(TypedDict):
    """Another letter that this one resembles."""

    letter: str
    """The letter."""
    p: float
    """Probability of the letter in the choice among all, 0 to 1."""


class RivalWord(TypedDict):
    """A word that a photo may be taken for."""

    word: str
    """The word."""
    p: float
    """Probability of the word in the choice between it and the expected one, 0 to 1."""


class Verdict(TypedDict):
    """Legibility of the word in a photo, with reasons."""

    word: str
    """The expected word."""
    read: str
    """The likeliest letter for each expected one, `?` for none. Punctuation is copied."""
    legible: bool
    """True if the readability reaches `legible_probability`, and no other word is likelier."""
    readability: float
    """Probability that a viewer reads the word at first sight, 0 to 1."""
    rival: RivalWord | None
    """The likeliest other word, or `None` if nothing is visible."""
    faithfulness: float | None
    """Agreement of light and intended strokes, 0 to 1: harmonic mean of the fraction of the strokes that has light and the fraction of the light that has strokes. `None` if it was not computed."""
    calibration: Calibration
    """The regression that gave the readability."""
    placement: Placement | None
    """Placement of the word, or `None` if there is no light."""
    cap_height_px: float | None
    """Height of a capital in the photo, pixels, or `None` if the word is outside the photo."""
    letters: list[LetterVerdict]
    """One verdict for each letter of the word, in its order."""
    reason: Reason | None
    """Why the word is not legible, or `None` if it is."""
    second_opinion: str | None
    """The text that is read without knowledge of the word, or `None` if nothing is visible."""
    causes: list[Cause]
    """Faults, the most costly first, or empty if not computed."""
    advice: list[Advice]
    """At most three changes, those with the largest gain first, or empty if not computed."""
