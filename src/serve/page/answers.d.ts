// What the server answers: made by tests/it/answer_types.rs of the types in Rust. Read by tsc alone.

/** Facts for the pages of visitors and of the operator. */
interface About extends Host {
  /** True if the page works without a server. */
  alone?: boolean;
  /** True if the page runs on the host's machine. */
  home: boolean;
  /** True if the page runs on a public screen in the hall. */
  kiosk: boolean;
  /** True if the operator has paused accepting entries. */
  paused: boolean;
  /** Rule that selects the photos on the wall. */
  wall: WallRule;
  /** Limits of requests. */
  limits: Limits;
  /** Colors in which a visitor can write. */
  colors: OfferedColor[];
  /** Light deck of the scene. */
  deck: string;
  /** Text of the scene's file, if the visitors' browsers make photos. */
  base?: string;
  /** Scene that the controls show at the start, on the host's machine. */
  scene?: Record<string, any>;
}

/** A sentence of advice. */
interface Advice {
  /** The kind of fault that the advice removes. */
  kind: CauseKind;
  /** The advice as a sentence. */
  text: string;
  /** Gain in readability, 0 to 1, if the photo is read without any fault of this kind. The gain is null if such faults cannot be removed. */
  gain: number | null;
}

/** The members of a request that the page receives back with the answer. */
interface Asked {
  /** Name of the stored request for a large photo, which the page sends to have the photo flown. */
  id?: string;
  /** Number of the request. */
  number: number | null;
}

/** Texts that the host of an evening provides. */
interface Brand {
  /** Name of the evening. */
  title: string | null;
  /** Description of the evening, by language. */
  sentence: Record<string, string>;
  /** Terms that a visitor accepts by sending a photo, by language. */
  consent: Record<string, string>;
  /** True if the host provides a logo. */
  logo: boolean;
}

/** `m` is the mean log-odds of the letters, and `r` the log-odds of the word against its rival. `s` measures how common the spelling is: the mean natural logarithm of the probability of each letter after the preceding four, plus 2.2, multiplied by 1 − m / 8 for m from 0 to 8. */
interface Calibration {
  /** The human readers whose success the regression predicts. */
  reader: string;
  /** Constant of the regression. */
  constant: number;
  /** Weight of the letters' mean log-odds, each within −9 and 8. */
  mean_log_odds: number;
  /** Weight of the log-odds of the word against the likeliest other word, within ±9. */
  rival: number;
  /** Weight of the spelling, `s` above. */
  spelling: number;
}

/** A fault in the photo, and the gain if the fault is removed. */
interface Cause {
  /** Kind of the fault. */
  kind: CauseKind;
  /** Index of the letter, from 0. null if the fault concerns the whole word. */
  letter: number | null;
  /** Length, distance or width of the fault, in the plane of the word. */
  length_mm: number | null;
  /** Center of the fault in the plane of the word: x to the right and y upward. */
  at_m: [number, number] | null;
  /** The missing part of a stroke, if the fault is one. */
  missing: MissingRun | null;
  /** Switching delay of the lamp, if light connects two strokes and the drone's speed is known. */
  lamp_delay_s: number | null;
  /** Start and end times of the log gap that caused a missing part of a stroke. */
  log_gap_s: [number, number] | null;
  /** The letter that this one looks like, if the fault lies in the font's design. */
  reads_as: string | null;
  /** Gain in the letter's probability, −1 to 1, if the photo is read without the fault. The gain is null if the fault cannot be removed. */
  gain: number | null;
}

/** Kind of a fault. */
type CauseKind = "missing_run" | "log_gap" | "lit_transit" | "streak" | "dwell_blob" | "overlap" | "other_stray" | "shifted" | "glow" | "few_pixels" | "dim" | "design" | "off_path";

/** Scene key, and the value to which it should be set. */
interface Change {
  /** Dotted key in the scene file. */
  key: string;
  /** Value in scene-file syntax, or null if the sentence only says to raise or lower it. */
  value: string | null;
}

/** A drawing as its file contains it. Coordinates are whole pixels of a picture, or thousandths of the larger side of another drawing. y points down. */
interface DrawnSource {
  /** Corners of the sheet of paper. */
  corners: [[number, number], [number, number], [number, number], [number, number]] | null;
  /** All strokes in the order of their numbers. */
  strokes: DrawnStroke[];
}

/** A stroke of a drawing's file. */
interface DrawnStroke {
  /** Coordinates of the points in the order x, y, x, y … */
  at: number[];
  /** Name of the stroke's color. */
  color: string | null;
}

/** Facts about a photo that are stored with its entry. */
interface Figures {
  /** Number of drones, or 0 in an entry of an earlier version. */
  drones: number;
  /** Duration of the longest flight, in s. */
  flight_s: number;
  /** True if the word is legible. For a drawing, this value is null, and so are the letters, the reading and the reason. */
  legible: boolean | null;
  letters: LetterVerdict[] | null;
  /** Problems that make any word unreadable. */
  obstacles: Message[];
  read: string | null;
  /** Probability that the word is read, or null for a drawing or an older entry. */
  readability: number | null;
  reason: Reason | null;
  /** Checks that stop the flight. There are none, because such a photo is refused. */
  stops: Message[];
}

/** Note for the operator about the log of a flight. */
interface FlightNote {
  /** Key of the note's sentence on the page. */
  key: string;
  /** Name of the log. */
  name: string;
  /** Reason in English, or the word that was flown according to the log. */
  why: string;
}

/** Photo of an entry's flight. */
interface FlownPhoto {
  /** Name of the photo's files without extensions, such as `flown-2` for the second flight. */
  name: string;
  /** Probability that the word is read, or null for a drawing. */
  readability: number | null;
}

/** An entry as the operator receives it. Its fields are borrowed, because long queues are requested often. */
interface ForOperator extends Figures {
  id: string;
  number: number;
  title: string | null;
  made: string;
  state: State;
  hidden: boolean;
  visitor: string | null;
  flown: FlownPhoto | null;
}

/** An entry as its visitor receives it. */
interface ForVisitor {
  id: string;
  number: number;
  title: string | null;
  /** Date on which the entry was made. */
  made: string;
  state: State;
  language: string;
  flight_s: number;
  read: string | null;
  legible: boolean | null;
  readability: number | null;
  /** Photo of the entry's flight, if its log was followed. */
  flown: FlownPhoto | null;
  /** Number of entries that fly before this one, and the time that they take in s. */
  ahead: number;
  ahead_s: number;
  /** Time since take-off in s, or null if it is unknown or the entry is not in the air. */
  flown_s: number | null;
}

/** Facts for the pages of all roles. */
interface Host {
  /** Role of the page's user. */
  role: Role;
  /** Random name of this run of the program. */
  boot: string;
  /** The host's own texts. */
  brand: Brand;
  /** True if the server accepts other machines, and they can reach it. */
  network: boolean;
}

/** Facts about the large photo, which consist of the members of `preview --json` and further facts for the page. */
interface LargeFacts extends PhotoFacts, Partial<Verdict> {
  /** Controller of the flight. */
  controller: Record<string, any>;
  /** Number of drones. */
  drones: number;
  /** SHA-256 digests of the flights. */
  flight_sha256: string | null;
  /** Changes that make an unreadable word easier to read. */
  remedies: Suggestion[];
  /** Checks that stop the flight. */
  stops: Message[];
}

/** The verdict on one letter. */
interface LetterVerdict {
  /** The expected letter. */
  expected: string;
  /** The likeliest letter, or null if it is likelier that no letter is there. */
  best: string | null;
  /** Probability of the expected letter among all letters, 0 to 1, if the other letters of the word are right. null for punctuation, which is not judged. */
  p: number | null;
  /** Probability that no letter is there, 0 to 1. null for punctuation. */
  no_letter: number | null;
  /** The three likeliest other letters, in descending order of probability. */
  rivals: Rival[];
  /** Offset of the letter from its position in the word (right, up). This field and the next four are null if they were not computed. */
  shift_m: [number, number] | null;
  /** Fraction of the moved intended strokes that have light within 0.1 cap heights. */
  recall: number | null;
  /** Fraction of the lines of light that is within 0.1 cap heights of an intended stroke. */
  precision: number | null;
  /** Length of the intended strokes that have no light. */
  missing_mm: number | null;
  /** Length of the lines of light that are away from the intended strokes. */
  stray_mm: number | null;
  /** Probabilities of all letters that have a probability of at least 0.001, in descending order. */
  confusion: Rival[];
}

/** Path of the light over time. */
interface LightMap {
  /** Duration of the longest flight, in s. */
  seconds: number;
  /** Strokes of light in the order of their first times. */
  strokes: MappedStroke[];
}

/** Limits of a page's requests. */
interface Limits {
  /** Maximum number of characters in a word. */
  letters: number;
  /** Maximum number of bytes in the body of a request. */
  body_bytes: number;
}

/** Facts about the photo that is shown while a visitor types. */
interface LiveFacts extends PhotoFacts {
  /** Strokes of the drawing, or null for a word. */
  source: DrawnSource | null;
  /** Verdict, or null for a drawing. */
  verdict: Verdict | null;
}

/** Stroke of light as the page receives it. */
interface MappedStroke {
  /** Points in the order t, x, y, t, x, y …, with t in 1/100 s, and x and y in 1/10000 of the photo. */
  at: number[];
  /** Index of the letter that the stroke is part of, or null in a drawing. */
  letter: number | null;
  /** Color of the light on a screen (sRGB). */
  rgb: [number, number, number];
}

/** A message to a visitor. */
interface Message {
  /** Key of the sentence, such as `word-long`. */
  key: string;
  /** Values in the sentence. Their names end in their units. */
  values: any;
  /** An English sentence, for a page that lacks the key. */
  text: string;
  /** Advice in English, or empty. */
  hint: string;
}

/** A part of an intended stroke without light. */
interface MissingRun {
  /** Index of the run of the pen within the letter. */
  stroke: number;
  /** Position along the run where the missing part starts. */
  from_mm: number;
  /** Position along the run where the missing part ends. */
  to_mm: number;
}

/** A color that the page offers, with its values on the screen and for each lamp. */
interface OfferedColor {
  /** Name of the color. */
  name: string;
  /** Red, green and blue on the screen (sRGB). */
  screen: [number, number, number];
  /** Levels of white, red, green and blue for the color LED deck. */
  "color-led": [number, number, number, number];
  /** Levels of white, red, green and blue for the LED ring. */
  ring: [number, number, number, number];
}

/** Facts about a photo of either size. */
interface PhotoFacts {
  /** Box of each letter, or an empty list for a drawing. */
  boxes: ([number, number, number, number] | null)[];
  /** Duration of the longest flight, in s. */
  flight_s: number;
  /** Height of the photo, in pixels. */
  height: number;
  /** Problems that make any word unreadable. */
  obstacles: Message[];
  /** Path of the light over time. */
  replay: LightMap;
  /** Other problems of the picture. */
  warnings: Message[];
  /** Width of the photo, in pixels. */
  width: number;
}

/** Placement of the word relative to the intended one. */
interface Placement {
  /** Shift in the plane of the word: x to the right and y upward. */
  shift_m: [number, number];
  /** Ratio of the size to the intended size. */
  scale: number;
  /** Counterclockwise rotation about the center of the word. */
  rotation_rad: number;
}

/** The complete queue, for the operator. */
interface Queue {
  revision: number;
  paused: boolean;
  /** In the order of flight. */
  entries: ForOperator[];
  /** Name of the entry in the air. */
  flying: string | null;
  /** Notes about the logs of flights. */
  notes: FlightNote[];
}

/** The reason why a word is not legible. */
type Reason = "not_in_photo" | "no_light" | "too_small" | "out_of_range" | "other_length" | "misread" | "unsure";

/** Another letter that this one resembles. */
interface Rival {
  /** The letter. */
  letter: string;
  /** Probability of this letter among all letters, 0 to 1. */
  p: number;
}

/** Another word that a photo may be read as. */
interface RivalWord {
  /** The word. */
  word: string;
  /** Probability, 0 to 1, that a viewer who must choose prefers this word to the expected one. */
  p: number;
}

/** Role of the person who uses a page. */
type Role = "visitor" | "operator" | "entry";

/** State of an entry. */
type State = "waiting" | "approved" | "flying" | "flown" | "rejected";

/** Changes to a scene that make its word easier to read. */
interface Suggestion {
  /** Increase of the probability that the word is read. */
  gain: number;
  /** Sentence that describes the changes. */
  message: Message;
  /** The changed keys with their values. */
  set: Change[];
}

/** Legibility of the word in a photo, with reasons. */
interface Verdict {
  /** The expected word. */
  word: string;
  /** The likeliest letter for each expected one, or `?` for no letter. Punctuation is copied. */
  read: string;
  /** True if no other word is likelier and the readability reaches `legible_probability`. */
  legible: boolean;
  /** Probability that a viewer reads the word at first sight, 0 to 1. */
  readability: number;
  /** The likeliest other word, or null if nothing is visible. */
  rival: RivalWord | null;
  /** Agreement of the light with the intended strokes, 0 to 1: the harmonic mean of the fraction of strokes with light and the fraction of light near strokes. The value is null if it was not computed. */
  faithfulness: number | null;
  /** The regression from which the readability was computed. */
  calibration: Calibration;
  /** Placement of the word, or null if the photo does not show the word's light. */
  placement: Placement | null;
  /** Height of a capital in the photo in pixels, or null if the word is outside the photo. */
  cap_height_px: number | null;
  /** The verdict on each letter, in the order of the word. */
  letters: LetterVerdict[];
  /** The reason why the word is not legible, or null if it is. */
  reason: Reason | null;
  /** The text that blind recognition reads in the photo, or null if nothing is visible. */
  second_opinion: string | null;
  /** Faults, in order of decreasing gain. The list is empty if faults were not computed. */
  causes: Cause[];
  /** Advice on at most three changes, in order of decreasing gain. Empty if not computed. */
  advice: Advice[];
}

/** Photos on the wall. */
interface Wall {
  revision: number;
  photos: WallPhoto[];
}

interface WallPhoto {
  key: string;
  title: string | null;
  flight_s: number;
  /** True if the entry is in the air. */
  flying: boolean;
  readability: number | null;
  /** Photo of the entry's flight, if its log was followed. */
  flown: FlownPhoto | null;
  /** True if the wall shows the light of the flight so far. */
  live: boolean;
}

/** Rule that selects the photos on the wall. */
type WallRule = "approved" | "open";
