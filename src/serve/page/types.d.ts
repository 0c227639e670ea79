// Types of the page itself, beside those of answers (answers.d.ts). Read by tsc alone.

/** An answer of `live`. */
type Shot = Asked & LiveFacts & { photo: string };

/** An answer of `photos`. */
type Large = Asked &
  LargeFacts & {
    photo: string;
    /** Those that were saved, in base64, by their names. */
    files: Record<string, string>;
    /** What it was made of. */
    wish: object;
  };

/** What is read in a photograph of either size. */
type Judged = NonNullable<Shot["verdict"]>;

/** A message, or what the page itself says. */
type Said = Pick<Message, "key" | "text"> & Partial<Message>;

interface About {
  /** Whether this browser cannot make photographs, and the server does. */
  slow?: boolean;
}

type Corners = NonNullable<DrawnSource["corners"]>;

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
