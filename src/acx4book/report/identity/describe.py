"""Identification, method and data of a report."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
import pyproj

from acx4book.report.material import Material
from acx4book.report.shown import Text, show, table
from acx4book.report.words import listed
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.plain_text import code
from acx4lib.bundle.gross_errors.rejections import CRITICAL
from acx4lib.calibration.estimates import TWO_STEP
from acx4lib.flight.block import Block
from acx4lib.flight.design import levels
from acx4lib.least_squares.statistical.gauss_markov import GaussMarkov
from acx4lib.results.folder import STAGES

ITEM, VALUE = "Item", "Statement"


def identity(material: Material) -> Text:
    """Return the section on the flight, its files and the software."""
    return show(
        table(identification(material), "Identification", name="tab-report-identification"),
        table(files(material), "Files of the flight", name="tab-report-files", obtained=READ),
    )


def method_and_data(material: Material) -> Text:
    """Return the section on the method and on the data that it used."""
    name, caption = "tab-report-data", "The blocks, with σ a priori"
    return show(method(material), table(data_table(material), caption, name=name, obtained=COUNTED))


READ = "SHA-256 of every table as it was read; the results folder keeps copies of them"
COUNTED = (
    "counted in the tables of the flight; σ are those of the tables' own columns, or of [apriori] "
    "in flight.toml, and are the weights of the adjustments"
)


def identification(material: Material) -> pd.DataFrame:
    """Return the calibrated cameras, the date, and the software."""
    flight = material.flight
    made = "Simulated: the measurements were computed" if flight.simulated else ""
    rows = [("Flight", flight.name), *([("Measurements", made)] if made else [])]
    rows += [(f"Camera {name}", text) for name, text in _cameras(material).items()]
    crs = pyproj.CRS.from_user_input(flight.grid.crs)
    rows += [
        ("Coordinate system", f"{crs.name} ({flight.grid.crs})"),
        ("Heights", _heights(flight.grid.height_system)),
        ("Refraction", _refraction(flight.refraction)),
        ("Stages computed", listed([s for s in STAGES if s in material.provenance.stages])),
        ("Results of", f"{material.date.day} {material.date:%B %Y} (UTC)"),
        ("Software", _software(material)),
        ("Data, SHA-256", code(material.provenance.digest)),
    ]
    return pd.DataFrame(rows, columns=[ITEM, VALUE])


def _cameras(material: Material) -> dict[str, str]:
    return {
        name: (
            f"{camera.width_px} × {camera.height_px} pixels of {1000 * camera.pixel_mm:.3g} µm; "
            f"declared focal length {camera.interior.f:g} mm"
        )
        for name, camera in material.flight.cameras.items()
    }


def _heights(heights: str) -> str:
    return "above the ellipsoid" if heights == "ellipsoidal" else f"by {heights}"


def _refraction(refraction: str) -> str:
    return "not corrected" if refraction == "none" else f"{refraction} atmosphere"


def _software(material: Material) -> str:
    """Return the software versions of the stages; several if they differ."""
    said = [dict(entry["versions"]) for entry in material.provenance.stages.values()]  # type: ignore[call-overload] # read from JSON
    texts = {", ".join(f"{name} {version}" for name, version in one.items()) for one in said}
    return "; ".join(sorted(texts))


def files(material: Material) -> pd.DataFrame:
    """Return every table of the flight with its checksum."""
    return pd.DataFrame(
        [(code(name), code(sha256)) for name, sha256 in material.provenance.files.items()],
        columns=["File", "SHA-256"],
    )


# --- method ----------------------------------------------------------------------------------

METHODS: Mapping[str, str] = {
    "heads": (
        "**Heads.** Every camera head was calibrated by itself, in a bundle adjustment with "
        "self-calibration: the collinearity equations {eq}`eq-1` to {eq}`eq-6`, with the "
        "distortion of Brown's model, {eq}`eq-7` to {eq}`eq-11`, subtracted from the measured "
        "point. Exterior orientations are free; control points are observations with their "
        "standard deviations. Estimated: %s. From them follows the orientation of the heads in "
        "the frame of the synthetic image."
    ),
    "single_step": (
        "**Calibration.** One adjustment estimates the interior orientation, the boresight and "
        "the lever arm, equation {eq}`eq-14` in place of free exterior orientations. "
        "Observations are image points, control points, and position and attitude of every "
        "exposure from GNSS and INS. Estimated of the interior orientation: %s."
    ),
    "two_step": (
        "**Calibration.** A bundle adjustment with self-calibration on control points, then the "
        "mean boresight and lever arm of all exposures, equations {eq}`eq-12` and {eq}`eq-13`, "
        "weighted by their covariance matrices. Estimated of the interior orientation: %s."
    ),
    "given": "**Calibration.** None; the cameras are validated as the flight declares them.",
}


CARRIED = (
    "**Synthetic images.** Points were measured in the images of the heads. Their rays, corrected "
    "by the calibrated heads, were carried into the synthetic image of each exposure, and the "
    "calibration and the validation of its camera use these. Their standard deviations are those "
    "of the measurements; errors of the heads' calibration are not part of them."
)

ESTIMATION = (
    "**Estimation.** Least squares with the a priori standard deviations as weights, iterated to "
    "convergence. Standard deviations follow from the full covariance matrix, multiplied by the "
    "root of the variance of unit weight. Gross errors were looked for by w-tests with the "
    f"critical value {CRITICAL:g}, and taken out."
)


def method(material: Material) -> str:
    """Return what was computed, with the numbers of the equations, as Markdown."""
    flight, parts = material.flight, []
    if any(name.startswith("heads/bundle") for name in material.adjustments):
        parts.append(METHODS["heads"] % _names(flight.estimate_heads))
    chosen = material.calibration.partition("/")[2]
    key = "two_step" if chosen in TWO_STEP else chosen or "given"
    text = METHODS[key]
    parts.append(text % _names(flight.estimate_mounting) if "%s" in text else text)
    if flight.carried:
        parts.insert(-1, CARRIED)
    if flight.fix:
        parts[-1] += f" Held: {listed([name.replace('_', ' ') for name in flight.fix])}."
    if flight.gnss and chosen == "single_step":
        named = [name.replace("_", " ") for name in flight.gnss]
        parts[-1] += f" Estimated errors of the trajectory: {listed(named)}."
    if material.adjustments:
        parts.append(ESTIMATION)
    if flight.validation is not None:
        parts.append(
            "**Validation.** Check points of an independent block, intersected from the "
            "trajectory and the calibrated camera alone; no coordinate on the ground took part."
        )
    return "\n\n".join(parts)


def _names(keys: tuple[str, ...]) -> str:
    return listed([LABELS.get(key, LABELS.get(f"{key}_mm", key)) for key in keys]) or "nothing"


# --- data ------------------------------------------------------------------------------------


def mapped(material: Material) -> tuple[Block, ...]:
    """Return the blocks used for the calibration; without any, that of the validation."""
    blocks = material.flight.blocks
    used = [blocks[name] for name in ("heads", "calibration") if name in blocks]
    return tuple(used or blocks.values())


def data_table(material: Material) -> pd.DataFrame:
    """Return the content of every block and its standard deviations, a column per block."""
    columns = {name: _of_block(block) for name, block in material.flight.blocks.items()}
    table = pd.DataFrame(columns)
    table.insert(0, "Quantity", table.index)
    return table.reset_index(drop=True)


def _of_block(block: Block) -> dict[str, str]:
    rays = block.rays[block.rays > 0]
    n_surveyed = len(block.control) + len(block.check)
    found = levels(block)
    return {
        "cameras": ", ".join(camera.name for camera in block.cameras),
        "images": f"{len(block.images)}",
        "exposures": f"{len(block.trajectory)}",
        "strips": f"{len({s for s in block.images.strips if s}) or 'not named'}",
        "flying heights (m)": _joined([level.height_m for level in found], ".0f"),
        "ground pixels (cm)": _joined([100 * level.gsd_m for level in found], ".1f"),
        "measured image points": f"{len(block.image_points):,}",
        "tie points": f"{len(rays) - n_surveyed:,}",
        "images per point, mean": f"{rays.mean():.1f}" if len(rays) else "–",
        "control points": f"{len(block.control)}",
        "check points": f"{len(block.check)}",
        **_apriori(block),
    }


def _apriori(block: Block) -> dict[str, str]:
    surveyed = np.concatenate([block.control.sigma_m, block.check.sigma_m])
    position = block.trajectory.sigma_position
    attitude = np.degrees(block.trajectory.sigma_attitude)
    return {
        "σ image points (px)": _range(block.image_points.sigma_px),
        "σ survey, plan (m)": _range(surveyed[:, :2]),
        "σ survey, height (m)": _range(surveyed[:, 2]),
        "σ GNSS, plan (m)": _range(position[:, :2]),
        "σ GNSS, height (m)": _range(position[:, 2]),
        "σ roll and pitch (°)": _range(attitude[:, :2]),
        "σ heading (°)": _range(attitude[:, 2]),
        **_slow("GNSS", block.trajectory.slow_positions),
        **_slow("attitudes", block.trajectory.slow_attitudes),
    }


def _slow(of: str, process: GaussMarkov) -> dict[str, str]:
    """Return how errors are correlated in time; nothing where they are independent."""
    if process.share == 0:
        return {}
    return {
        f"{of}: correlated share of σ": f"{process.share:g}",
        f"{of}: time constant of the correlation (s)": f"{process.time_constant_s:g}",
    }


def _joined(values: list[float], spec: str) -> str:
    return ", ".join(f"{v:{spec}}" for v in values if np.isfinite(v)) or "–"


def _range(values: np.ndarray) -> str:
    """Return the smallest and the largest number as text; only one if they do not differ."""
    if not values.size:
        return "–"
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if f"{low:.3g}" == f"{high:.3g}" else f"{low:.3g} to {high:.3g}"
