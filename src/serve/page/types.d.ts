// What the server answers, as /about.json, /live and the others have it. Read by tsc alone.

/** A sentence as data: worded by `key`, or `text` where the page lacks the key. */
interface Said {
  key: string;
  values?: Record<string, any>;
  /** Of a drawing that is too much. */
  source?: Source | null;
  text: string;
  hint?: string;
}

/** When the lamp was where: t in 1/100 s, x and y in 1/10000 of the photograph. */
interface Replay {
  seconds: number;
  strokes: { rgb: [number, number, number]; letter: number | null; at: number[] }[];
}

interface Letter {
  expected: string;
  best: string | null;
  p: number | null;
}

interface Verdict {
  word?: string;
  read: string;
  legible: boolean;
  readability: number;
  reason: string | null;
  letters: Letter[];
}

/** An answer of `live`. */
interface Shot {
  number: number;
  photo: string;
  width: number;
  height: number;
  verdict: Verdict | null;
  flight_s: number;
  obstacles: Said[];
  warnings: Said[];
  replay: Replay;
  /** A box for each letter, in 1/10000 of the photograph: left, top, right, bottom. */
  boxes?: [number, number, number, number][];
  /** Of a drawing. */
  source?: Source | null;
}

type Corners = [[number, number], [number, number], [number, number], [number, number]];

/** A drawing as its file has it: whole pixels of a picture, thousandths of any other; y down. */
interface Source {
  /** Those of the sheet of paper that is drawn. */
  corners: Corners | null;
  /** All strokes in the order of their numbers: places are x, y, x, y … */
  strokes: { color: string | null; at: number[] }[];
}

interface Remedy {
  gain: number;
  set: { key: string; value: string }[];
  said: Said;
}

/** An answer of `photos`: that of `preview --json`, and what the page needs. */
interface Large extends Partial<Verdict> {
  number: number;
  photo: string;
  /** Those that were saved, in base64, by their names. */
  files: Record<string, string>;
  /** What it was made of. */
  wish: object;
  flight_s: number;
  replay: Replay;
  obstacles: Said[];
  warnings: Said[];
  stops: Said[];
  remedies: Remedy[];
  /** The controller that flew, as the scene has it. */
  controller: Record<string, any>;
}

type Wrgb = [number, number, number, number];

interface About {
  role: "visitor" | "operator" | "entry";
  home: boolean;
  /** Whether the page has no server. */
  alone?: boolean;
  kiosk: boolean;
  network: boolean;
  wall: "approved" | "open";
  paused: boolean;
  boot: string;
  limits: { letters: number; body_bytes: number };
  brand: {
    title: string | null;
    sentence?: Record<string, string>;
    consent?: Record<string, string>;
    logo: boolean;
  };
  /** The text of the page's scene, where visitors' browsers make their photographs. */
  base?: string;
  /** Whether this browser cannot make them, and the server does. */
  slow?: boolean;
  /** The scene of the page, at home alone. */
  scene?: Record<string, any>;
  /** Its deck of lights. */
  deck: string | null;
  colors: { name: string; screen: [number, number, number]; "color-led": Wrgb; ring: Wrgb }[];
}

type EntryState = "waiting" | "approved" | "flying" | "flown" | "rejected";

interface Entry {
  id: string;
  number: number;
  title: string | null;
  made: string;
  state: EntryState;
  hidden: boolean;
  flight_s: number;
  read: string | null;
  legible: boolean | null;
  reason: string | null;
  letters: Letter[] | null;
  stops: Said[];
  obstacles: Said[];
  visitor: string;
  drones: number;
  language?: string;
  page?: string;
  ahead?: number;
  ahead_s?: number;
}

/** A stroke of the pad: points are x, y in the page's units and seconds. */
interface Stroke {
  id: number;
  color: string;
  points: [number, number, number][];
}

/** A file that was opened in place of a word. */
interface Opened {
  name: string;
  kind: "svg" | "json" | "jpg" | "log";
  /** A picture and a log in base64. */
  text: string;
  /** Width and height of a picture. */
  size?: [number, number];
  /** Whether strokes have colors, which a lamp of one color has not. */
  colored?: boolean;
  /** Whether it is seen in place of the photograph, to choose what is drawn. */
  choosing?: boolean;
  /** Corners of the paper that were set by hand. */
  corners?: Corners;
  /** Numbers of the strokes that are left out, of so many. */
  out?: number[];
  of?: number;
}
