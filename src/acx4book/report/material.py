"""The material of a report: a results folder with its copy of the flight."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from acx4files.results import folder as results
from acx4files.results.provenance import KEPT, Run, read_run
from acx4lib.calibration.estimates import METHODS
from acx4lib.errors import FlightError


class Material(Run):
    """A run with the residuals and adjustments of its report."""

    @property
    def adjustments(self) -> tuple[str, ...]:
        """Names of the adjustments, ``stage/method`` or ``heads/bundle/CAM1``."""
        return tuple(
            name
            for name, entry in self.found.summary.items()
            if name.startswith(("heads/bundle", "mounting/"))
            and entry.get("sigma0_squared") is not None
        )

    @cached_property
    def calibration(self) -> str:
        """The calibrating method, preferably the single step; empty if there is none."""
        ordered = sorted(METHODS, key=lambda method: method != "single_step")
        listed = set(self.found.parameters["stage"] + "/" + self.found.parameters["method"])
        return next((f"mounting/{m}" for m in ordered if f"mounting/{m}" in listed), "")

    @property
    def certified(self) -> str:
        """The certified adjustment: the calibration, or the single step without unknowns.

        Empty where no mounting was adjusted.
        """
        single = "mounting/single_step"
        return self.calibration or (single if single in self.adjustments else "")

    @property
    def decisive(self) -> tuple[str, ...]:
        """The adjustments of the verdict: the certified one and all heads."""
        return tuple(
            n for n in self.adjustments if n == self.certified or n.startswith("heads/bundle")
        )

    def entry(self, name: str) -> Mapping[str, Any]:
        """Return what summary.json says of a ``stage/method``; empty where it says nothing."""
        return self.found.summary.get(name, {})

    @property
    def methods(self) -> list[str]:
        """Names of the methods whose parameters are certified: the calibration, and all heads."""
        heads = ["heads/bundle"] if results.has(self.found, "heads/bundle") else []
        return [name for name in (self.calibration, *heads) if name]

    @cached_property
    def residuals(self) -> Mapping[str, pd.DataFrame]:
        """The residuals of every decisive adjustment, by its name."""
        methods = {name: "/".join(name.split("/")[:2]) for name in self.decisive}
        rows = {m: results.rows(self.found, "residuals", m) for m in set(methods.values())}
        return {name: _of_camera(self, name, rows[m]) for name, m in methods.items()}

    @property
    def date(self) -> dt.date:
        """Date of the results, from the file time of summary.json."""
        changed = (self.folder / "summary.json").stat().st_mtime
        return dt.datetime.fromtimestamp(changed, tz=dt.UTC).date()


def read(folder: str | Path) -> Material:
    """Read everything that a report needs.

    Parameters
    ----------
    folder : path
        The results of a run.

    Raises
    ------
    FlightError
        Where the folder does not exist, is not complete, was changed after the run, or is being
        written.
    """
    folder = results.of_run(folder)
    missing = [
        name for name in (*results.FILES, f"{KEPT}/flight.toml") if not (folder / name).is_file()
    ]
    if missing:
        problem = f"{folder}: not complete, without {', '.join(missing)}; run all stages again"
        raise FlightError([problem])
    run = read_run(folder)
    material = Material(found=run.found, flight=run.flight, provenance=run.provenance)
    if not material.found.summary:
        raise FlightError([f"{folder}: no stage left results; run acx4 run first"])
    return material


def validated(material: Material) -> str:
    """Return the name of the validation of the calibration, or of the given cameras.

    The calibration may be that of an earlier flight.
    """
    earlier = [name for name in earlier_calibrations(material) if name.endswith("/single_step")]
    if not material.calibration and earlier_calibrations(material):
        return (*earlier, *earlier_calibrations(material))[0]
    return f"validation/{material.calibration.partition('/')[2] or 'given'}"


def earlier_calibrations(material: Material) -> Mapping[str, Mapping[str, Any]]:
    """Return the records of calibrations from an earlier flight, by the names of validations."""
    calibrations = {n: entry.get("calibration") for n, entry in material.found.summary.items()}
    return {
        name: calibration
        for name, calibration in calibrations.items()
        if isinstance(calibration, dict)
    }


def checked_points(material: Material) -> pd.DataFrame:
    """Return the check points of the validation with the calibration, or with given cameras."""
    rows = material.found.check_points
    return rows[rows["stage"] + "/" + rows["method"] == validated(material)]


def _of_camera(material: Material, adjustment: str, rows: pd.DataFrame) -> pd.DataFrame:
    """Select an adjustment's rows from its method's rows: all, or one head's."""
    camera = adjustment.split("/")[2:]
    if not camera:
        return rows
    block = material.flight.block("heads")
    names = [c.name for c in block.cameras]
    idx = block.images.camera_idx
    camera_of = {image: names[k] for image, k in zip(block.images.names, idx, strict=True)}
    # the image points of a head come first; its control points, without an image, follow
    of_camera = rows["image_or_exposure"].map(camera_of).ffill() == camera[0]
    return rows[of_camera].reset_index(drop=True)
