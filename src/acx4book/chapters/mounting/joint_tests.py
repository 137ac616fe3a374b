"""Several parameters tested at once: from their covariance, and by adjusting without them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.labels import group_label, p_value
from acx4lib.calibration.correlations import nested_f_ratio
from acx4lib.calibration.mounting import Mounting
from acx4lib.calibration.trust.joint_tests import GroupTest, group_tests, undistorted
from acx4lib.errors import AdjustmentError
from acx4lib.flight.reader import Flight
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM, REPORTED

COLUMNS = (
    *("Camera", "Parameters", "against", "largest single t", "F", "F, adjusted without them"),
    *("degrees of freedom", "p"),
)
FORMATS = {"largest single t": ".1f", "F": ".2f", "F, adjusted without them": ".2f"}

NOTHING = "There is no single step, and so nothing to test."


def table(flight: Flight, single: Mounting | None) -> pd.DataFrame:
    """Return the joint tests of the single step's parameters.

    Parameters
    ----------
    flight : Flight
        The printed values are tested, too, where it has the paper's cameras.
    single : Mounting or None
        No rows without it.
    """
    rows = [] if single is None else list(_rows(flight, single))
    found = pd.DataFrame(rows, columns=list(COLUMNS))
    return found if len(set(found["Camera"])) > 1 else found.drop(columns="Camera")


def _rows(flight: Flight, single: Mounting) -> Iterator[tuple[object, ...]]:
    declared = single.bundle.network.block.cameras
    for test, nested in _tests(single, [undistorted(camera) for camera in declared]):
        lens = not set(test.keys) & {*LEVER_ARM, *BORESIGHT}
        yield _row(test, nested, "zero" if lens else "declared")
    if printed.applies(flight) and len(declared) == 1:
        for test, nested in _tests(single, [printed_camera(declared[0])]):
            yield _row(test, nested, "printed")


def _tests(single: Mounting, against: list[Camera]) -> Iterator[tuple[GroupTest, float]]:
    """Yield the tests against given cameras, each with the F-ratio of its nested adjustment."""
    redundancy = single.bundle.solution.redundancy
    for test in group_tests(single.calibration, against, redundancy=redundancy):
        try:
            yield test, nested_f_ratio(single.bundle, test, against)
        except AdjustmentError:  # held so far off, it has no solution
            yield test, np.nan


def _row(test: GroupTest, nested: float, against: str) -> tuple[object, ...]:
    return (
        *(test.camera, group_label(test.keys), against, test.largest, test.f_ratio, nested),
        *(f"{len(test.keys)}; {test.redundancy:,}", p_value(test.p)),
    )


def printed_camera(camera: Camera) -> Camera:
    """Return a camera with the values that the paper prints for its single step."""

    def values(keys: tuple[str, ...]) -> list[float]:
        return [printed.value(3, REPORTED[key][0], "single_step") for key in keys]

    mounted = Pose(
        R=rotation_from_opk(np.radians(values(BORESIGHT))), r=np.array(values(LEVER_ARM))
    )
    return replace(camera, interior=printed.interior(3, "single_step"), T_b_c=mounted)


def sentence(single: Mounting | None) -> str:
    """Say what single tests hide: the group whose members seem least significant beside it."""
    if single is None:
        return NOTHING
    against = [undistorted(camera) for camera in single.bundle.network.block.cameras]
    redundancy = single.bundle.solution.redundancy
    tests = group_tests(single.calibration, against, redundancy=redundancy)
    if not tests:
        return "No two parameters of a group are estimated, so none are tested together."
    most = max(tests, key=lambda test: np.sqrt(len(test.keys) * test.f_ratio) / test.largest)
    size = np.sqrt(len(most.keys) * most.f_ratio)
    return (
        f"Single tests hide most of {group_label(most.keys)}: the largest of their t is "
        f"{most.largest:.1f}, but together they are {size:.1f} standard deviations away, "
        "$\\sqrt{kF}$."
    )
