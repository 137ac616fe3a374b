"""In-flight calibration of multi-head aerial cameras for direct georeferencing.

Conventions, each implemented once, in `geometry`:

- ``R_a_b`` takes components from frame b to frame a, ``r_a_b`` is the origin of b in a, and a
  pose ``T_a_b`` holds both; inner letters touch: ``T_m_c = T_m_b @ T_b_c``.
- Frames: m mapping (topocentric, east north up), b body (the IMU's: forward, left, up),
  c camera (x right, y up, z away from the ground), h head, s synthetic camera, e earth-centred.
- omega, phi, kappa are the paper's eq. (6), M = R3(kappa) R2(phi) R1(omega), object to image;
  ``rotation_from_opk`` returns its transpose, camera to object.
- Image coordinates are in mm from the middle of the image, x right, y up; pixels count from the
  centre of the top-left one, col to the right, row down.
- Distortion is a function of the measured point and is subtracted from it, eqs (1)-(2), (7)-(11).
- Lengths in m, in the image in mm; angles in radians; v = estimated less observed.

The five names of `__all__` are all that most programs need: ``import acx4lib as acx``, then
``flight = acx.read("my_flight")``. They, and the rooms, are loaded when they are first used.
Everything else is reached through its room, as in ``from acx4lib.results import tables``.
"""

from importlib import import_module

TYPE_CHECKING = False
if TYPE_CHECKING:
    from acx4lib.flight.reader import from_tables, read
    from acx4lib.georeferencing.direct import georeference
    from acx4lib.production.flight_images import render_flight as render
    from acx4lib.stages.mounting import calibrate

__all__ = ["calibrate", "from_tables", "georeference", "read", "render"]

_STANDS_IN = {
    "calibrate": ("stages.mounting", "calibrate"),
    "from_tables": ("flight.reader", "from_tables"),
    "georeference": ("georeferencing.direct", "georeference"),
    "read": ("flight.reader", "read"),
    "render": ("production.flight_images", "render_flight"),
}

_OF_PIXELS = ("cv2", "tifffile", "imagecodecs")


def __getattr__(name: str) -> object:
    """Load a function of `__all__`, or a room, on first use."""
    module, function = _STANDS_IN.get(name, (name, ""))
    try:
        loaded = import_module(f"{__name__}.{module}")
    except ModuleNotFoundError as error:
        if error.name in _OF_PIXELS:
            errors = import_module(f"{__name__}.errors")
            raise errors.not_installed(f"acx4lib.{name}", error.name, "images") from None
        if error.name != f"{__name__}.{name}":
            raise
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None
    return getattr(loaded, function) if function else loaded


def __dir__() -> list[str]:
    """Return the names of loaded and lazily loaded attributes."""
    return sorted({*globals(), *__all__})
