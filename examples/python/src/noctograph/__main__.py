"""The program `noctograph`: `noctograph preview HELLO`, `python -m noctograph preview HELLO`."""

import signal
import sys

from ._noctograph import main as run


def main() -> int:
    # Ctrl-C ends the program, which does not return to Python before it is done.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return run([sys.executable, "-m", "noctograph"], sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
