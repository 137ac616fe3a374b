"""What every model makes of a flight: its fit, what it predicts, and errors at check points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.distortion_models.candidates import Fitted, single_step
from acx4book.chapters.beyond.distortion_models.cases import CASES, Case, decentred, with_dent
from acx4book.chapters.beyond.distortion_models.families import CENTRAL, MODELS, Model
from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.calibration.estimates import from_bundle
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block
from acx4lib.georeferencing.validation import validate

Row = dict[str, Any]


def of_seed(seed: int) -> list[Row]:
    """Return a row for every case and model of a flight.

    Returns
    -------
    list of dict
        case, seed, model; what `of_fit`, `of_strips` and `of_validation` return.
    """
    rows = []
    for name, fly in CASES.items():
        case = fly(seed)
        rows += [{"case": name, "seed": seed} | of_model(case, model) for model in MODELS]
    return rows


DEPTHS_UM = (0.0, 10.0, 20.0, 30.0, 40.0, 60.0)
"""Depths of the dent for which a flight is repeated."""

FLEXIBLE = "radial + Fourier"
"""The model that follows a dent best."""


def over_depth(seed: int) -> pd.DataFrame:
    """Return what Brown's model and the most flexible one make of dents of several depths.

    Returns
    -------
    DataFrame
        depth_um, model, and what `of_model` returns.
    """
    flat = decentred(seed)
    rows = [
        {"depth_um": depth} | of_model(with_dent(flat, depth), model)
        for depth in DEPTHS_UM
        for model in MODELS
        if model.name in (MODELS[0].name, FLEXIBLE)
    ]
    return pd.DataFrame(rows)


def halved_at_um(found: pd.DataFrame, name: str) -> float:
    """Return the depth at which the flexible model halves an error, µm; infinite for none.

    Parameters
    ----------
    found : DataFrame
        As `over_depth` returns it.
    name : str
        A column of errors.
    """
    wide = found.pivot_table(index="depth_um", columns="model", values=name)
    share = (wide[FLEXIBLE] / wide[MODELS[0].name]).to_numpy()
    if share.min() > 0.5:
        return np.inf
    first = int(np.argmax(share <= 0.5))
    at = slice(first - 1, first + 1)
    return float(np.interp(0.5, share[at][::-1], wide.index.to_numpy()[at][::-1]))


def of_model(case: Case, model: Model) -> Row:
    """Return what a model makes of a case."""
    fitted = single_step(case.calibration, model)
    return {
        "model": model.name,
        **of_fit(fitted),
        **of_strips(case.calibration, model),
        **of_validation(fitted, case.validation),
    }


def of_fit(fitted: Fitted) -> Row:
    """Return how well a model fits, and how well its parameters are determined.

    Returns
    -------
    dict
        cost, observations, redundancy; parameters, the number of those of distortion; estimated,
        of all of the camera; joint, the chi-square of all parameters beyond the radial ones over
        their number, and its probability joint_p; correlation, the largest of two of the camera's
        parameters.
    """
    solution = fitted.bundle.solution
    columns, values = asymmetric(fitted)
    joint, p = fitted.significance(columns, values)
    cov = fitted.covariance(fitted.camera_columns)
    scale = np.sqrt(np.diagonal(cov))
    related = cov / scale[:, None] / scale
    return {
        "cost": solution.cost,
        "observations": solution.n_observations,
        "redundancy": solution.redundancy,
        "parameters": fitted.model.n_distortion,
        "estimated": len(fitted.camera_columns),
        "joint": joint,
        "joint_p": p,
        "correlation": float(np.abs(related - np.eye(len(related))).max()),
    }


def asymmetric(fitted: Fitted) -> tuple[list[int], Array]:
    """Return the columns and values of all parameters of distortion but the radial ones."""
    names = [name for name in fitted.model.free if name not in CENTRAL]
    skip = sum(name.startswith("k") for name in names)
    return fitted.distortion_columns[skip:], fitted.estimates[skip:]


def of_strips(block: Block, model: Model) -> Row:
    """Return what strips left out show: RMS of residuals, px, and at check points, m."""
    found = [leave_out(block, model, strip) for strip in strips(block)]
    residuals = np.vstack([own.residuals for own in found])
    return {"strip_px": _rms(residuals)} | _axes("strip", np.vstack([p.errors for p in found]))


def of_validation(fitted: Fitted, block: Block) -> Row:
    """Return the RMS of differences at check points of direct georeferencing, m."""
    found = validate(fitted.in_block(block), from_bundle(fitted.bundle), method="single_step")
    return _axes("direct", found.points.d)


def _axes(name: str, d: Array) -> Row:
    """Return the RMS in plan, by coordinate, and in height."""
    return {f"{name}_plan_m": _rms(d[:, :2]), f"{name}_height_m": _rms(d[:, 2])}


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


# --- a strip predicted from the others: their camera is held in it ----------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Predicted:
    """What a strip contradicts of the camera that the other strips found.

    Attributes
    ----------
    strip : str
    residuals : ndarray, shape (n, 2)
        Of its image points, px.
    errors : ndarray, shape (k, 3)
        Of its check points, which are control points of the other strips, m.
    """

    strip: str
    residuals: Array
    errors: Array


def strips(block: Block) -> tuple[str, ...]:
    """Return the strips of a block, each once."""
    return tuple(dict.fromkeys(block.images.strips))


def only(block: Block, keep: Mask) -> Block:
    """Return the block in which only the measurements of some images are used."""
    points = block.image_points
    sigma = np.where(keep[points.image_idx], points.sigma_px, np.inf)
    return replace(block, image_points=replace(points, sigma_px=sigma))


def leave_out(block: Block, model: Model, strip: str) -> Predicted:
    """Adjust a block without a strip, and then this strip alone, with the camera held.

    Parameters
    ----------
    block : Block
    model : Model
    strip : str
        One of `strips`.
    """
    own = np.array([name == strip for name in block.images.strips])
    return predict(single_step(only(block, ~own), model), only(block, own), strip)


def predict(fitted: Fitted, block: Block, strip: str) -> Predicted:
    """Adjust measurements with a camera that is held, without control."""
    control = replace(block.control, sigma_m=np.full(block.control.sigma_m.shape, np.inf))
    held = replace(fitted.in_block(block), control=control)
    bundle = adjust(mounted_orientation(held, free=(), free_mount=()))
    return Predicted(
        strip=strip,
        residuals=bundle.solution.group("image_point").v,
        errors=check_errors(bundle, block),
    )


def check_errors(bundle: Bundle, block: Block) -> Array:
    """Return estimated less surveyed coordinates of control points that were not used, m."""
    idx = block.control.point_idx
    seen = np.isin(idx, bundle.network.image_points.point_idx)
    errors: Array = (bundle.state.x_m[idx] - block.control.x_m)[seen]
    return errors
