"""Tables and records of a results folder, made from adjustments and validations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import union_categoricals

from acx4files.flight.reader import Flight
from acx4files.results import sentences
from acx4files.results.folder import COLUMNS, COMPONENTS, RELATIVE, Record, messages
from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network
from acx4lib.bundle.observations import DECLARED, declared
from acx4lib.bundle.rejections import Rejection, Stopped, sentence
from acx4lib.calibration import estimates, trajectory_errors
from acx4lib.calibration.estimates import Calibration, Parameter
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.frames import Pose, opk_jacobian
from acx4lib.geometry.parameters import REPORTED
from acx4lib.georeferencing import accuracy
from acx4lib.georeferencing.direct import pose_covariances
from acx4lib.georeferencing.validation import Prediction, Validation, compare
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.synthetic_image.transferred_points import TransferredPoints

TRANSFERRED = "synthetic/points"
"""Key of the points transferred into synthetic images."""

NO_ADJUSTMENT: Mapping[str, object] = dict.fromkeys(
    (
        *("n_observations", "n_unknowns", "redundancy", "sigma0_squared", "chi_square_p"),
        *("iterations", "n_rejected", "n_left_out"),
    )
)
"""Entries of summary.json for an adjustment that was not made or failed."""


def record(key: str, tables: Mapping[str, pd.DataFrame], entry: Mapping[str, object]) -> Record:
    """Return the record of a method, whose tables do not have its stage and name yet.

    Parameters
    ----------
    key : str
        Of its object in summary.json, which begins with stage and method.
    tables : mapping of str to DataFrame
        By the names of `COLUMNS`.
    entry : mapping of str to object
        The object.
    """
    cells = dict(zip(("stage", "method"), key.split("/"), strict=False))
    named = {}
    for name, frame in tables.items():
        first = {c: _names([of], np.zeros(len(frame), int)) for c, of in cells.items()}
        named[name] = frame.assign(**first)[list(COLUMNS[name])]
    return Record(tables=named, summary={key: dict(entry)})


def not_adjusted(key: str, reason: str, *, of: str = "left_out") -> Record:
    """Return the record of a method that was left out or, `of` ``not_determined``, failed."""
    return record(key, {}, {**NO_ADJUSTMENT, "converged": False, of: [f"{key}: {reason}"]})


def extended(
    made: Record, entries: Mapping[str, object], notes: Iterable[str], *, of: str = ""
) -> Record:
    """Return a record with more entries and notes; these are `of` its key, or something else."""
    ((key, entry),) = made.summary.items()
    said = [*messages(entry, "notes"), *(f"{of or key}: {note}" for note in notes)]
    return replace(made, summary={key: {**entry, **entries, "notes": said}})


# --- bundles ---------------------------------------------------------------------------------


def of_bundle(
    key: str, bundle: Bundle, calibration: Calibration, diagnosed: Mapping[str, object]
) -> Record:
    """Return the record of an adjusted bundle.

    Parameters
    ----------
    key : str
        As in `record`.
    bundle : Bundle
    calibration : Calibration
        The cameras calibrated by the method.
    diagnosed : mapping of str to object
        What its diagnosis adds to the object of summary.json.
    """
    solution, left_out = bundle.solution, bundle.network.left_out
    tables = {
        **_with_trajectory(bundle, calibration),
        "exterior_orientation": exterior_orientations(bundle),
        "residuals": _residuals(bundle),
        "rejected": _rejected(bundle.network.block, bundle.rejected),
        "check_points": _check_points(bundle),
    }
    entry = {
        "n_observations": solution.n_observations,
        "n_unknowns": solution.n_unknowns,
        "redundancy": solution.redundancy,
        "sigma0_squared": solution.sigma0_sq,
        "chi_square_p": solution.chi_square_p,
        "iterations": solution.iterations,
        "converged": True,
        "n_rejected": len(bundle.rejected),
        **_stopped(key, bundle.stopped),
        "n_left_out": sum(left_out.values()),
        "left_out_points": dict(left_out),
        **_turns(calibration.turns),
    }
    return record(key, tables, {**entry, **diagnosed})


def _turns(turns: Array | None) -> dict[str, object]:
    """Return the entry of summary.json on picture turns; empty without any."""
    return {} if turns is None else {"picture_turns_deg": np.degrees(turns).tolist()}


def _stopped(key: str, stopped: Sequence[Stopped]) -> dict[str, object]:
    """Return the entries of summary.json on groups with too many rejections, so none made."""
    return {
        "stopped": [f"{key}: {sentence(stopped)}"] if stopped else [],
        "stopped_groups": [[group.group, group.n_rejected, group.n] for group in stopped],
    }


def calibration_tables(calibration: Calibration) -> dict[str, pd.DataFrame]:
    """Return the tables of the determined parameters and of their covariance."""
    listed, cov = estimates.parameters(calibration), estimates.reported_covariance(calibration)
    return parameter_tables(listed, cov, np.flatnonzero(estimates.is_determined(calibration)))


def _with_trajectory(bundle: Bundle, calibration: Calibration) -> dict[str, pd.DataFrame]:
    """Return the tables of a calibration, extended by estimated errors of the trajectory."""
    more = trajectory_errors.parameters(bundle)
    if not more:
        return calibration_tables(calibration)
    cov = trajectory_errors.reported_covariance(bundle)
    if max(calibration.enlarged) > 1 or calibration.cov_before is not None:
        n = calibration.n_columns
        cov[:n, :n] = estimates.reported_covariance(calibration)
    determined = [
        *estimates.is_determined(calibration),
        *trajectory_errors.is_determined(bundle),
    ]
    listed = [*estimates.parameters(calibration), *more]
    return parameter_tables(listed, cov, np.flatnonzero(determined))


def parameter_tables(
    listed: Sequence[Parameter], cov: Array, kept: Index | None = None
) -> dict[str, pd.DataFrame]:
    """Return the table of parameters and that of their covariance; of all, or of those kept."""
    if kept is not None:
        listed, cov = [listed[i] for i in kept], cov[np.ix_(kept, kept)]
    columns = COLUMNS["parameters"][2:]
    fields = [column.replace("parameter", "name") for column in columns]
    rows = [[getattr(parameter, name) for name in fields] for parameter in listed]
    return {
        "parameters": pd.DataFrame(rows, columns=list(columns)),
        "covariance": _covariance([p.full_name for p in listed], cov),
    }


def _covariance(names: Sequence[str], cov: Array) -> pd.DataFrame:
    n, texts = len(names), np.array(names, dtype=object)
    return pd.DataFrame(
        {"row": np.repeat(texts, n), "column": np.tile(texts, n), "value": cov.ravel()}
    )


def covariance(calibration: Calibration) -> pd.DataFrame:
    """Return the a posteriori covariance of a calibration, named ``camera/parameter``, (n, n)."""
    names = [p.full_name for p in estimates.parameters(calibration)]
    return pd.DataFrame(estimates.reported_covariance(calibration), index=names, columns=names)


def exterior_orientations(bundle: Bundle) -> pd.DataFrame:
    """Return the exterior orientations of an adjusted bundle's images, with their sigma.

    Returns
    -------
    DataFrame
        A row for every image that its measurements orient: ``image``, projection centre
        ``east_m, north_m, height_m``, angles ``omega_deg, phi_deg, kappa_deg`` of eq. (6) against
        the grid's axes, and the sigma of each, a posteriori. A mounted camera's have the sigma
        and the correlations of body pose and mounting, eq. (14).
    """
    network = bundle.network
    cov = bundle.camera_pose_covariances * bundle.solution.sigma0_sq
    oriented = np.flatnonzero(bundle.oriented)
    names = [network.block.images.names[i] for i in oriented]
    return exterior_table(network.block, names, T_m_c=bundle.T_m_c[oriented], cov=cov[oriented])


def exterior_table(block: Block, names: Sequence[str], *, T_m_c: Pose, cov: Array) -> pd.DataFrame:
    """Return camera poses relative to the grid, with their standard deviations.

    Parameters
    ----------
    block : Block
    names : sequence of str
        Names of the images.
    T_m_c : Pose
    cov : ndarray, shape (n, 6, 6)
        Position in m, mapping frame; rotation about the camera's axes, radians.
    """
    enh, opk = block.frame.pose_to_grid(T_m_c)
    sigma_r = sigmas(propagate(block.frame.grid_axes(T_m_c.r), cov[:, :3, :3]))
    sigma_opk = np.degrees(sigmas(propagate(opk_jacobian(opk), cov[:, 3:, 3:])))
    values = [enh, np.degrees(opk), sigma_r, sigma_opk]
    return _table("exterior_orientation", values, image=names)


def _table(name: str, values: Sequence[Array], **texts: Any) -> pd.DataFrame:
    """Return a table with columns of text, or counts, before its last columns of numbers."""
    numbers = np.column_stack(values)
    columns = list(COLUMNS[name][-numbers.shape[1] :])
    return pd.DataFrame(numbers, columns=columns).assign(**texts)[[*texts, *columns]]


def _check_points(bundle: Bundle) -> pd.DataFrame:
    """Return the differences at check points that the bundle estimated as tie points."""
    network, block = bundle.network, bundle.network.block
    n_images = np.bincount(network.image_points.point_idx, minlength=network.n_points)
    check = np.flatnonzero(n_images[block.check.point_idx] >= 2)
    idx = block.check.point_idx[check]
    values = compare(block, bundle.state.x_m[idx], bundle.solution.cov_points[idx], check)
    names = [block.points[i] for i in idx]
    return _table("check_points", values, point=names, n_images=n_images[idx])


def _rejected(block: Block, rejected: Sequence[Rejection]) -> pd.DataFrame:
    """Return the table of the observations rejected as gross errors."""
    rows = []
    for r in rejected:
        place, point, quantity = "", "", "measurement"
        if r.kind == "image_point":
            place = block.images.names[block.image_points.image_idx[r.row]]
            point = block.points[block.image_points.point_idx[r.row]]
        elif r.kind == "control_point":
            point = block.points[block.control.point_idx[r.row]]
            quantity = (*COMPONENTS["control_point"], "position")[r.component]  # -1: position
        else:
            place = block.trajectory.exposures[r.row]
            quantity = "position" if r.kind == "gnss" else "attitude"
        reason = f"{quantity}: w = {r.statistic:.1f} exceeds {r.limit:.3g}"
        rows.append((r.kind, place, point, r.statistic, reason))
    return pd.DataFrame(rows, columns=list(COLUMNS["rejected"][2:]))


# --- residuals -------------------------------------------------------------------------------


def unit_of(kind: str, component: int = 0) -> float:
    """Return the factor of a residual component in results: radians to degrees, otherwise 1."""
    return float(np.degrees(1.0)) if COMPONENTS[kind][component].endswith("_deg") else 1.0


def _residuals(bundle: Bundle) -> pd.DataFrame:
    """Return the residuals of all used observations, with their names as categories."""
    groups = [group for group in bundle.solution.groups if group.kind in COMPONENTS]
    parts: dict[str, list[pd.Categorical[str]]] = {name: [] for name in COLUMNS["residuals"][2:6]}
    units = []
    for group in groups:
        rows, components = np.nonzero(group.used)
        image_or_exposure, point = _observed_at(bundle.network, group.kind)
        parts["kind"].append(_names([group.kind], np.zeros(len(rows), int)))
        parts["image_or_exposure"].append(image_or_exposure[rows])
        parts["point"].append(point[rows])
        parts["component"].append(_names(COMPONENTS[group.kind], components))
        units.append(np.full(len(rows), unit_of(group.kind)))
    unit = np.concatenate(units)
    v, sigma, redundancy, w = (
        np.concatenate([getattr(group, name)[group.used] for group in groups])
        for name in ("v", "sigma", "redundancy", "w")
    )
    values = {"v": unit * v, "sigma": unit * sigma, "redundancy": redundancy, "w": w}
    texts = {name: union_categoricals(columns) for name, columns in parts.items()}
    return pd.DataFrame({**texts, **values}, copy=False)  # of arrays that nobody else has


def _names(names: Sequence[str], idx: Index) -> pd.Categorical[str]:
    return pd.Categorical.from_codes(idx, pd.Index(list(names)))


def _observed_at(network: Network, kind: str) -> tuple[pd.Categorical[str], pd.Categorical[str]]:
    """Return the image, exposure or camera, and the point, of every row of a group."""
    block, points = network.block, network.image_points
    cameras = [camera.name for camera in block.cameras]
    if kind == "image_point":
        images = _names(block.images.names, points.image_idx)
        return images, _names(block.points, points.point_idx)
    if kind == "control_point":
        idx = network.control.point_idx[~network.held_control]
        return _names([""], np.zeros(len(idx), int)), _names(block.points, idx)
    if kind in DECLARED:
        at = _names(cameras, declared(block.cameras, kind, network.layout)[0])
    else:
        at = _names(block.trajectory.exposures, network.exposure_idx)
    return at, _names([""], np.zeros(len(at), int))


# --- heads -----------------------------------------------------------------------------------


def of_relative_orientation(
    key: str, orientation: RelativeOrientation, **entries: object
) -> Record:
    """Return the record of heads oriented in the synthetic frame.

    Other keyword arguments become entries of the summary.
    """
    known = {"n_exposures": orientation.n_exposures, **_turns(orientation.turns)}
    entry = {**NO_ADJUSTMENT, "converged": True, **known, **entries}
    return record(key, orientation_tables(orientation), entry)


def orientation_tables(orientation: RelativeOrientation) -> dict[str, pd.DataFrame]:
    """Return the parameters of heads in the synthetic frame, and their joint covariance."""
    names, scale = joint_names([head.name for head in orientation.heads], np.degrees(1.0))
    cov = orientation.cov_joint * scale[:, None] * scale
    n = orientation.xyz_mm.size + orientation.opk.size
    kept = np.flatnonzero((np.arange(len(cov)) < n) | (np.diag(cov) > 0))
    values = np.hstack([orientation.xyz_mm, np.degrees(orientation.opk)])
    parameters = pd.DataFrame(
        {
            "camera": [name.partition("/")[0] for name in names[:n]],
            "parameter": [name.partition("/")[2] for name in names[:n]],
            "value": values.ravel(),
            "sigma": orientation.sigma.ravel() * scale[:n],
            "unit": np.tile(np.repeat(["mm", "deg"], 3), len(values)),
            "sigma_before": 0.0,
        }
    )
    covariances = _covariance([names[i] for i in kept], cov[np.ix_(kept, kept)])
    return {"parameters": parameters, "covariance": covariances}


def joint_names(heads: Sequence[str], angle: float) -> tuple[list[str], Array]:
    """Return names in the order of `RelativeOrientation.cov_joint`, and factors, `angle` or 1."""
    names = [f"{head}/{name}" for head in heads for name in RELATIVE]
    interior = [f"{head}/{REPORTED[key][0]}" for head in heads for key in INTERIOR]
    factors = np.tile(np.repeat([1.0, angle], 3), len(heads))
    return names + interior, np.concatenate([factors, np.ones(len(interior))])


def of_transferred(flight: Flight, transferred: Mapping[str, TransferredPoints]) -> Record:
    """Return the record of the points of blocks, by block, transferred into synthetic images."""
    entry = {
        **NO_ADJUSTMENT,
        "converged": True,
        "n_observations": 2 * sum(map(len, transferred.values())),
        "n_left_out": sum(points.n_left_out for points in transferred.values()),
        "measured": {k: v for name in transferred for k, v in measured(flight, name).items()},
    }
    tables = []
    for name, points in transferred.items():
        block = flight.block(name)
        texts = {
            "block": [name] * len(points),
            "image": [block.trajectory.exposures[i] for i in points.exposure_idx],
            "point": [block.points[i] for i in points.point_idx],
            "head": [block.cameras[i].name for i in points.camera_idx],
        }
        tables.append(_table("synthetic_points", [points.colrow, points.sigma_px], **texts))
    return record(TRANSFERRED, {"synthetic_points": pd.concat(tables)}, entry)


def measured(flight: Flight, block: str) -> dict[str, str]:
    """Return the digests of the tables on which the transferred points of a block depend."""
    files = [f"{block}/{name}" for name in ("images.csv", "image_points.csv")]
    return {file: flight.sha256[file] for file in files}


# --- validations -----------------------------------------------------------------------------


def of_validation(validation: Validation, entries: Mapping[str, object]) -> Record:
    """Return the record of one method's validation; `entries` are added to its summary."""
    block, pairs, points = validation.block, validation.pairs, validation.points
    checked, images = np.array(block.points)[block.check.point_idx], np.array(block.images.names)
    T_m_c = validation.georeferenced.T_m_c
    cov = pose_covariances(block, validation.georeferenced)
    as_control = replace(block, control=block.check, check=block.control)
    tables = {
        "validation": _table(
            "validation",
            [pairs.d, pairs.sigma],
            point=checked[pairs.point_idx],
            image_a=images[pairs.image_idx[:, 0]],
            image_b=images[pairs.image_idx[:, 1]],
        ),
        "check_points": _table(
            "check_points",
            [points.d, points.sigma],
            point=checked[points.point_idx],
            n_images=points.n_images,
        ),
        "exterior_orientation": exterior_table(block, images.tolist(), T_m_c=T_m_c, cov=cov),
        "rejected": _rejected(as_control, validation.rejected),  # they are check points
    }
    key = f"validation/{validation.method}"
    return record(key, tables, {**_validation_entry(key, validation), **entries})


def _validation_entry(key: str, validation: Validation) -> dict[str, object]:
    points, spread = validation.points, validation.spread
    over_points = accuracy.from_differences(points.d)
    bias = accuracy.bias_test(np.array(over_points.mean), validation.mean_cov)
    return {
        "n_observations": validation.n_observations,
        "n_unknowns": 3 * len(points),
        "redundancy": validation.redundancy,
        "sigma0_squared": validation.sigma0_sq,
        "chi_square_p": validation.chi_square_p,
        "joint_chi_square": validation.joint_chi_square,
        "joint_dof": validation.joint_dof,
        "joint_chi_square_p": validation.joint_chi_square_p,
        "iterations": 1,
        "converged": True,
        "n_rejected": len(validation.rejected),
        "expected_rejections": validation.expected_rejections,
        **_stopped(key, validation.stopped),
        "n_left_out": validation.n_left_out,
        "n_pairs": len(validation.pairs),
        "n_failed_pairs": validation.n_failed,
        "n_points": len(points),
        "height_offset_share": validation.height_offset[1],
        "notes": [f"{key}: {note}" for note in sentences.on_validation(validation)],
        **_statistics(accuracy.from_differences(validation.pairs.d)),
        "points": {
            **_statistics(over_points),
            "mean_sigma": sigmas(validation.mean_cov),
            "normalised_rms": [np.nan] * 3 if spread is None else spread.rms,
            "effective_number": [np.nan] * 3 if spread is None else spread.effective,
            "bias": {
                "statistic": bias.statistic,
                "critical": bias.critical,
                "accepted": bias.accepted,
            },
            "classes": accuracy.classes(over_points, survey_sigma=validation.survey_sigma),
        },
    }


def _statistics(measures: accuracy.Accuracy) -> dict[str, object]:
    return {"mean": measures.mean, "std": measures.std, "rms": measures.rms}


def prediction_entries(prediction: Prediction) -> dict[str, object]:
    """Return the entries of summary.json on the prediction of exposures without check points."""
    solution = prediction.bundle.solution
    return {
        "rays_rms_px": prediction.rays_rms_px,
        "position_rms_m": list(prediction.position_rms_m),
        "n_exposures": len(prediction.bundle.network.block.trajectory),
        "n_observations": solution.n_observations,
        "n_unknowns": solution.n_unknowns,
        "redundancy": solution.redundancy,
        "sigma0_squared": prediction.sigma0_sq,
        "chi_square_p": prediction.chi_square_p,
        "n_rejected": len(prediction.bundle.rejected),
    }
