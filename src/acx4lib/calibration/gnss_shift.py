"""The shift and the drifts of GNSS positions that a bundle estimated with its cameras."""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.estimates import Parameter, from_bundle, to_reported
from acx4lib.calibration.estimates import parameters as camera_parameters
from acx4lib.calibration.trust.needs import features, needed
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.parameters import AXES
from acx4lib.least_squares.covariance import correlation, propagate, sigmas

LIMIT_M = 1.0
"""Standard deviation above which a shift counts as not determined; for a drift, that of the
error at the end of its strip."""


def parameters(bundle: Bundle) -> list[Parameter]:
    """Return the estimated shift and drifts with their a posteriori standard deviations.

    They belong to no camera, so their camera's name is empty. A drift is in m per minute, or per
    exposure where the trajectory has no times.
    """
    strips, layout, state = bundle.network.observed.strips, bundle.network.layout, bundle.state
    per = "min" if strips.unit == "s" else "exposure"
    listed = [("shift", f"gnss_shift_{axis}_m", "m") for axis in AXES]
    listed += [
        ("drift", f"gnss_drift_{strip}_{axis}_m_per_{per}", f"m/{per}")
        for strip in strips.names
        for axis in AXES
    ]
    values = np.concatenate([state.shift, _drift_scale(bundle) * state.drift.ravel()])
    columns = np.concatenate([layout.shift, layout.drift.ravel()])
    sigma = sigmas(reported_covariance(bundle))
    return [
        Parameter(
            camera="",
            name=name,
            key=key,
            unit=unit,
            value=float(value),
            sigma=np.inf if bundle.solution.undetermined[column] else float(sigma[column]),
        )
        for (key, name, unit), value, column in zip(listed, values, columns, strict=True)
        if column >= 0
    ]


def _columns(bundle: Bundle) -> Index:
    layout = bundle.network.layout
    columns = np.concatenate([layout.shift, layout.drift.ravel()])
    return columns[columns >= 0]


def _drift_scale(bundle: Bundle) -> float:
    """Return the number of the strips' units of time in the unit of the report."""
    return 60.0 if bundle.network.observed.strips.unit == "s" else 1.0


def reported_covariance(bundle: Bundle) -> Array:
    """Return the joint a posteriori covariance of the cameras' parameters, shift and drifts.

    Returns
    -------
    ndarray, shape (n, n)
        First those of `estimates.parameters`, then those of `parameters`, in their units.
    """
    calibration, solution = from_bundle(bundle), bundle.solution
    n_drifts = bundle.network.layout.drift.size
    scale = np.ones(len(_columns(bundle)))
    scale[len(scale) - n_drifts :] = _drift_scale(bundle)
    J = block_diag(to_reported(calibration), np.diag(scale))
    first = np.arange(len(J))
    cov: Array = solution.sigma0_sq * propagate(J, solution.inverse.at(first[:, None], first))
    return cov


def is_determined(bundle: Bundle) -> Mask:
    """Tell for the shift and every drift whether the data determine it, shape (n,)."""
    observed = bundle.network.observed
    at_end = [
        float(np.abs(observed.strips.elapsed[observed.strips.idx == k]).max())
        for k in range(len(observed.strips.names))
    ]
    sigma = np.array([p.sigma for p in parameters(bundle)])
    n_drifts = bundle.network.layout.drift.size
    reach = np.ones(len(sigma))
    reach[len(sigma) - n_drifts :] = np.repeat(at_end, 3) / _drift_scale(bundle)
    return sigma * reach <= LIMIT_M


def not_determined(bundle: Bundle) -> list[str]:
    """Return one sentence per shift or drift that the data do not determine."""
    listed = parameters(bundle)
    if not listed:
        return []
    cameras = camera_parameters(from_bundle(bundle))
    labels = [f"{p.camera} {p.name}" for p in cameras] + [p.name for p in listed]
    related = correlation(reported_covariance(bundle))
    has = features(bundle.network.block)
    out = []
    for i in np.flatnonzero(~is_determined(bundle)):
        p, own = listed[i], related[len(cameras) + i].copy()
        own[len(cameras) + i] = 0.0
        strongest = np.argsort(-np.abs(own), kind="stable")[:2]
        with_others = ", ".join(f"{own[j]:+.2f} with {labels[j]}" for j in strongest)
        how = f"sigma {p.sigma:.3g} {p.unit}; correlation {with_others}"
        if np.isinf(p.sigma):  # an open parameter has no meaningful correlations
            how = "left open by the observations"
        out.append(f"{p.name} is not determined ({how}); it would need: {needed(p.key, has)}")
    return out


def notes(bundle: Bundle) -> list[str]:
    """Return sentences on the errors of GNSS positions: what was estimated, what was held."""
    layout = bundle.network.layout
    listed = [p for p, told in zip(parameters(bundle), is_determined(bundle), strict=True) if told]
    found = [
        f"{p.value:+.3f} ± {p.sigma:.3f} m ({axis})"
        for axis in AXES
        for p in listed
        if p.name == f"gnss_shift_{axis}_m"
    ]
    out = [f"GNSS positions are off by {', '.join(found)}"] if found else []
    if drifts := [p for p in listed if p.key == "drift"]:
        top = max(drifts, key=lambda p: abs(p.value) / p.sigma)
        out.append(f"the plainest drift is {top.name}: {top.value:+.3f} ± {top.sigma:.3f}")
    if np.any(layout.shift >= 0):
        held, free = "the lever arm's z", "the height of the GNSS shift"
        if layout.shift[2] < 0:
            held, free = free, held
        out.append(f"{held} is held, since it and {free} are one unknown")
    if len(_columns(bundle)):
        out.append(
            "the shift and drift of GNSS positions are this block's own: none is applied "
            "to another block, nor in the validation"
        )
    return out
