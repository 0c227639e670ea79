"""What stages find, as dictionaries: made by tests/it/answer_types.rs of the types in Rust."""

from __future__ import annotations

from typing import Any, Literal, TypedDict


class Advice(TypedDict):
    """A sentence of advice."""

    kind: CauseKind
    """The kind of fault that the advice removes."""
    text: str
    """The advice as a sentence."""
    gain: float | None
    """Gain in readability, 0 to 1, if the photo is read without any fault of this kind. The gain is `None` if such faults cannot be removed."""


class Calibration(TypedDict):
    """`m` is the mean log-odds of the letters, and `r` the log-odds of the word against its rival. `s` measures how common the spelling is: the mean natural logarithm of the probability of each letter after the preceding four, plus 2.2, multiplied by 1 − m / 8 for m from 0 to 8."""

    reader: str
    """The human readers whose success the regression predicts."""
    constant: float
    """Constant of the regression."""
    mean_log_odds: float
    """Weight of the letters' mean log-odds, each within −9 and 8."""
    rival: float
    """Weight of the log-odds of the word against the likeliest other word, within ±9."""
    spelling: float
    """Weight of the spelling, `s` above."""


class Candidate(TypedDict):
    """A point of the search space, and the figures of its flights."""

    number: int
    """Index of the candidate in the order of the search."""
    settings: dict[str, Any]
    """Values of the scene's keys that the knobs set, in the units of the keys."""
    n_flights: int
    """Number of flights from which the figures were computed."""
    merit: float
    """Mean merit."""
    legibility: float
    """Mean probability that the photo is read correctly."""
    legible: Estimate
    """Fraction of flights whose photo is legible."""
    duration_s: float | None
    """Mean duration of a flight. `None` if every drone was lost."""
    broken: float
    """Penalty before its weight: the sum of the excesses over the limits, each as a fraction of its limit, plus the fraction of flights with a lost drone. 0 if no limit is exceeded."""
    given_up: bool
    """True if the candidate was abandoned after half of its flights."""


class Cause(TypedDict):
    """A fault in the photo, and the gain if the fault is removed."""

    kind: CauseKind
    """Kind of the fault."""
    letter: int | None
    """Index of the letter, from 0. `None` if the fault concerns the whole word."""
    length_mm: float | None
    """Length, distance or width of the fault, in the plane of the word."""
    at_m: list[float] | None
    """Center of the fault in the plane of the word: x to the right and y upward."""
    missing: MissingRun | None
    """The missing part of a stroke, if the fault is one."""
    lamp_delay_s: float | None
    """Switching delay of the lamp, if light connects two strokes and the drone's speed is known."""
    log_gap_s: list[float] | None
    """Start and end times of the log gap that caused a missing part of a stroke."""
    reads_as: str | None
    """The letter that this one looks like, if the fault lies in the font's design."""
    gain: float | None
    """Gain in the letter's probability, −1 to 1, if the photo is read without the fault. The gain is `None` if the fault cannot be removed."""


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
    """Figure computed from all values."""
    low: float
    """Lower end of the confidence interval."""
    high: float
    """Upper end of the confidence interval."""


class Flown(TypedDict, total=False):
    """Figures of a flight."""

    contour_m: float
    """Mean distance from the path in the word's plane."""
    lag_s: float
    """Time lag relative to the design."""
    rmse_x_m: float
    """Root mean square error against the design along x."""
    rmse_y_m: float
    """Root mean square error against the design along y."""
    rmse_z_m: float
    """Root mean square error against the design along z."""
    drift_y_m: float
    """Maximum distance from the word's plane."""
    tilt_rad: float
    """Maximum tilt, which is the larger of roll and pitch."""
    saturated_frac: float
    """Fraction of the time in which a motor is saturated."""
    duration_s: float
    """Duration of the whole flight."""
    energy_j: float
    """Energy of the whole flight: current for thrust and electronics, times open-circuit voltage."""


class LetterVerdict(TypedDict):
    """The verdict on one letter."""

    expected: str
    """The expected letter."""
    best: str | None
    """The likeliest letter, or `None` if it is likelier that no letter is there."""
    p: float | None
    """Probability of the expected letter among all letters, 0 to 1, if the other letters of the word are right. `None` for punctuation, which is not judged."""
    no_letter: float | None
    """Probability that no letter is there, 0 to 1. `None` for punctuation."""
    rivals: list[Rival]
    """The three likeliest other letters, in descending order of probability."""
    shift_m: list[float] | None
    """Offset of the letter from its position in the word (right, up). This field and the next four are `None` if they were not computed."""
    recall: float | None
    """Fraction of the moved intended strokes that have light within 0.1 cap heights."""
    precision: float | None
    """Fraction of the lines of light that is within 0.1 cap heights of an intended stroke."""
    missing_mm: float | None
    """Length of the intended strokes that have no light."""
    stray_mm: float | None
    """Length of the lines of light that are away from the intended strokes."""
    confusion: list[Rival]
    """Probabilities of all letters that have a probability of at least 0.001, in descending order."""


class MissingRun(TypedDict):
    """A part of an intended stroke without light."""

    stroke: int
    """Index of the run of the pen within the letter."""
    from_mm: float
    """Position along the run where the missing part starts."""
    to_mm: float
    """Position along the run where the missing part ends."""


class Outcome(Flown, TypedDict):
    """Outcome of one trial, stored as a line in a `Store`."""

    read: str
    """Letters that were read."""
    all_read: bool
    """True if every letter was read as intended."""
    legible: bool
    """True if the word counts as legible."""
    probability: float
    """Probability that a viewer reads the word, and no other word, at first sight, 0 to 1: `read_probability`."""
    log_odds: float
    """Log-odds of the probability, −10 to 10, which distinguish probabilities close to 0 or 1."""
    similarity: float
    """Mean probability of the intended letters, 0 to 1, which varies even among illegible words."""
    lost: str | None
    """Cause of the loss of a drone. `None` if no drone was lost."""


class Placement(TypedDict):
    """Placement of the word relative to the intended one."""

    shift_m: list[float]
    """Shift in the plane of the word: x to the right and y upward."""
    scale: float
    """Ratio of the size to the intended size."""
    rotation_rad: float
    """Counterclockwise rotation about the center of the word."""


Reason = Literal[
    "not_in_photo",
    "no_light",
    "too_small",
    "out_of_range",
    "other_length",
    "misread",
    "unsure",
]
"""The reason why a word is not legible."""


class Rival(TypedDict):
    """Another letter that this one resembles."""

    letter: str
    """The letter."""
    p: float
    """Probability of this letter among all letters, 0 to 1."""


class RivalWord(TypedDict):
    """Another word that a photo may be read as."""

    word: str
    """The word."""
    p: float
    """Probability, 0 to 1, that a viewer who must choose prefers this word to the expected one."""


class Verdict(TypedDict):
    """Legibility of the word in a photo, with reasons."""

    word: str
    """The expected word."""
    read: str
    """The likeliest letter for each expected one, or `?` for no letter. Punctuation is copied."""
    legible: bool
    """True if no other word is likelier and the readability reaches `legible_probability`."""
    readability: float
    """Probability that a viewer reads the word at first sight, 0 to 1."""
    rival: RivalWord | None
    """The likeliest other word, or `None` if nothing is visible."""
    faithfulness: float | None
    """Agreement of the light with the intended strokes, 0 to 1: the harmonic mean of the fraction of strokes with light and the fraction of light near strokes. The value is `None` if it was not computed."""
    calibration: Calibration
    """The regression from which the readability was computed."""
    placement: Placement | None
    """Placement of the word, or `None` if the photo does not show the word's light."""
    cap_height_px: float | None
    """Height of a capital in the photo in pixels, or `None` if the word is outside the photo."""
    letters: list[LetterVerdict]
    """The verdict on each letter, in the order of the word."""
    reason: Reason | None
    """The reason why the word is not legible, or `None` if it is."""
    second_opinion: str | None
    """The text that blind recognition reads in the photo, or `None` if nothing is visible."""
    causes: list[Cause]
    """Faults, in order of decreasing gain. The list is empty if faults were not computed."""
    advice: list[Advice]
    """Advice on at most three changes, in order of decreasing gain. Empty if not computed."""
