"""The few functions that most programs need: ``import acx4 as acx``.

>>> flight = acx.read("my_flight")
>>> calibrations = acx.calibrate(flight)

`read` reads a flight's folder, `from_tables` its tables in memory; `calibrate` estimates cameras
and mounting by all methods; `georeference` applies eq. (14); `render` makes synthetic images; `run`
goes through all stages and writes results, `report` the calibration report of these. They are
loaded when they are first used. Everything else is reached by its room, as in
``from acx4lib.geometry import frames``.
"""

from importlib import import_module

TYPE_CHECKING = False
if TYPE_CHECKING:
    from acx4book.notebooks.runner import run
    from acx4book.report.page import write as report
    from acx4files.flight.reader import from_tables, read
    from acx4files.images.flight_images import render_flight as render
    from acx4files.stages.mounting import calibrate
    from acx4lib.georeferencing.direct import georeference

__all__ = ["calibrate", "from_tables", "georeference", "read", "render", "report", "run"]

_PLACES = {
    "calibrate": ("acx4files.stages.mounting", "calibrate"),
    "from_tables": ("acx4files.flight.reader", "from_tables"),
    "georeference": ("acx4lib.georeferencing.direct", "georeference"),
    "read": ("acx4files.flight.reader", "read"),
    "render": ("acx4files.images.flight_images", "render_flight"),
    "report": ("acx4book.report.page", "write"),
    "run": ("acx4book.notebooks.runner", "run"),
}

_OF_PIXELS = ("cv2", "tifffile", "imagecodecs")


def __getattr__(name: str) -> object:
    """Load a function of `__all__` on first use."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, function = _PLACES[name]
    try:
        return getattr(import_module(module), function)
    except ModuleNotFoundError as error:
        errors = import_module("acx4lib.errors")
        extra = "images" if error.name in _OF_PIXELS else "book"
        raise errors.not_installed(f"acx4.{name}", error.name, extra) from None


def __dir__() -> list[str]:
    """Return the names of loaded and lazily loaded attributes."""
    return sorted({*globals(), *__all__})
