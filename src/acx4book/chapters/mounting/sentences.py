"""Sentences of the mounting stage, with the numbers of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS, value_and_sigma
from acx4book.typesetting.plain_text import shown
from acx4lib.calibration.absorption import absorption
from acx4lib.calibration.estimates import Parameter, parameters
from acx4lib.calibration.mounting import Mounting, Mountings
from acx4lib.calibration.trajectory_errors import not_determined, notes
from acx4lib.expected import Array
from acx4lib.flight.reader import Flight
from acx4lib.geometry.frames import log
from acx4lib.geometry.parameters import BORESIGHT_ANGLES

FREE_OF_SHIFT = (
    "GNSS positions are taken to be free of a common shift; `gnss` in flight.toml makes one an "
    "unknown."
)


def scatter(flight: Flight, mounting: Mounting | None) -> str:
    """Say how the boresights of single images scatter, beside the precision of their mean.

    Parameters
    ----------
    flight : Flight
        The printed standard deviations are named where it has the paper's cameras.
    mounting : Mounting or None
        Of a two-step method with one camera; None where it was left out.
    """
    if mounting is None or mounting.per_image is None or mounting.averaged is None:
        return "There is no boresight of single images."
    turns = _turns_deg(mounting, mounting.per_image.R)[mounting.averaged]
    n, found = len(turns), np.std(turns, axis=0, ddof=1)
    sigma = {p.name: p.sigma for p in parameters(mounting.calibration)}
    mean = [sigma[name] for name in BORESIGHT_ANGLES if name in sigma]
    said = (
        f"The {n} boresights scatter by {listed(found, '.4f')}° in $\\omega$, $\\varphi$, "
        f"$\\kappa$. That over $\\sqrt{{{n}}}$ is {listed(found / np.sqrt(n), '.4f')}°; the "
        f"propagated standard deviations of the mean are {listed(mean, '.4f')}°."
    )
    if not printed.applies(flight):
        return said
    two, one = (
        ", ".join(_printed_sigma(name, method) for name in BORESIGHT_ANGLES)
        for method in printed.METHODS
    )
    return (
        f"{said} The paper prints {two}° for its two-step angles and "
        f"{one}° for the single-step ones: the former have the size of a scatter, "
        "the latter that of the precision of a mean."
    )


def _printed_sigma(name: str, method: str) -> str:
    cell = 3, name, method
    return printed.digits(printed.printed(*cell), printed.sigma(*cell))


def gnss_shift(single: Mounting | None) -> str:
    """Say what the single step estimated of GNSS positions and what it held, as a list."""
    if single is None:
        return "There is no single step, and so no shift of GNSS positions."
    lines = [*notes(single.bundle), *not_determined(single.bundle)]
    return "\n".join(f"- {shown(line[0].upper() + line[1:])}." for line in lines) or FREE_OF_SHIFT


def _turns_deg(mounting: Mounting, R_b_c: Array) -> Array:
    """Return every image's boresight against its camera's, about the body's axes, degrees."""
    camera_idx = mounting.bundle.network.block.images.camera_idx
    R = np.stack([camera.T_b_c.R for camera in mounting.calibration.cameras])[camera_idx]
    turns: Array = np.degrees(log(R_b_c @ np.swapaxes(R, 1, 2)))
    return turns


def listed(values: Iterable[float], spec: str) -> str:
    """Return numbers one after the other, between commas."""
    return ", ".join(f"{value:{spec}}" for value in values)


# --- the answer ------------------------------------------------------------------------------


def answer(flight: Flight, mountings: Mountings) -> str:
    """Say where the camera sits, and whether two methods agree: one sentence, then why.

    Parameters
    ----------
    flight : Flight
        The printed differences are named where it has the paper's cameras.
    mountings : Mountings
    """
    single = mountings.methods.get("single_step")
    if single is None or len(single.calibration.cameras) > 1:
        return "There is no single step of one camera, and so no answer."
    found = {p.name: p for p in parameters(single.calibration) if np.isfinite(p.sigma)}
    said = ", ".join(filter(None, (_together(found, *part) for part in PARTS)))
    taken_up = absorption(mountings)
    if taken_up is None:
        return f"The single step finds {said}.\n\nThe two methods cannot be compared here."
    shift, expected = taken_up.shift_mm[:3], (taken_up.by_lever @ taken_up.lever_m)[:3]
    differ = ", ".join(
        f"{off:+.4f} mm{_printed_difference(flight, name)} in {LABELS[name]}"
        for name, off in zip(INTERIOR, shift, strict=True)
    )
    return (
        f"The single step finds {said}; the two-step method differs from it by {differ}.\n\n"
        f"{BECAUSE} Least squares over this block says how much each must take up, and the "
        f"differences follow to {1e3 * np.abs(shift - expected).max():.2f} µm. {USE}"
    )


PARTS = (
    ("the lever arm", tuple(f"lever_{axis}_m" for axis in "xyz"), " m"),
    ("the boresight", BORESIGHT_ANGLES, "°"),
)
"""What the answer names, with the parameters and their unit."""

INTERIOR = ("f_mm", "xp_mm", "yp_mm")
"""What takes up the lever arm."""

BECAUSE = (
    "The reason is the lever arm, which the two-step method does not know: focal length and "
    "principal point take it up."
)
USE = (
    "Either set of values may be used, but only as a set, and only near the flying heights of the "
    "calibration."
)


def _together(found: Mapping[str, Parameter], title: str, names: Sequence[str], unit: str) -> str:
    """Return values and standard deviations of some parameters; empty where one is missing."""
    if not set(names) <= found.keys():
        return ""
    each = ", ".join(value_and_sigma(found[n].value, found[n].sigma) for n in names)
    return f"{title} {each}{unit}"


def _printed_difference(flight: Flight, name: str) -> str:
    if not printed.applies(flight):
        return ""
    two, one = (printed.value(3, name, method) for method in printed.METHODS)
    return f" (printed: {two - one:+.4f})"
