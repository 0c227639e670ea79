"""Exceptions and warnings of noctograph, which state what was found, where, and what to do."""

import inspect
import warnings


class InputError(ValueError):
    """An input value cannot be used.

    Attributes
    ----------
    place, found, wanted, hint : str
        Where it stands, what is there, what is accepted, and advice.
    """

    def __init__(self, place: str, found: str, wanted: str, hint: str) -> None:
        super().__init__(f"{place}: found {found}, wanted {wanted} ({hint})")
        self.place, self.found, self.wanted, self.hint = place, found, wanted, hint

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return type(self), (self.place, self.found, self.wanted, self.hint)


class InfeasibleError(RuntimeError):
    """The input is well formed, but cannot be carried out.

    Attributes
    ----------
    what, hint : str
        The reason, and advice.
    """

    def __init__(self, what: str, hint: str) -> None:
        super().__init__(f"{what} ({hint})")
        self.what, self.hint = what, hint

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return type(self), (self.what, self.hint)


class NoctographWarning(UserWarning):
    """Something is doubtful or missing: units and axes of a flight, light outside the picture, dark lamps.

    ``warnings.filterwarnings("error", category=nc.NoctographWarning)`` makes it an exception.
    """


def warn(text: str) -> None:
    """Issues a warning at the line outside the package from which this was called."""
    frame, level = inspect.currentframe(), 1
    while frame is not None and str(frame.f_globals.get("__name__")).split(".")[0] == "noctograph":
        frame, level = frame.f_back, level + 1
    warnings.warn(text, NoctographWarning, stacklevel=level)
