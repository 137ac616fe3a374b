"""Records of the adjustments for a results folder, one for each method."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from acx4files.flight.reader import Flight
from acx4files.results import folder as results
from acx4files.results import provenance, sentences
from acx4files.results.folder import COLUMNS
from acx4files.results.read_back import METHOD, measured_files
from acx4files.results.rows import (
    bundle_tables,
    exterior_table,
    of_method,
    orientation_tables,
    point_table,
    rejected_table,
)
from acx4lib.attempts import Failed
from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.rejections import CRITICAL, Stopped, sentence
from acx4lib.calibration.estimates import (
    LIMIT_SCALE,
    Calibration,
)
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array
from acx4lib.georeferencing import accuracy, error_sources
from acx4lib.georeferencing.direct import pose_covariances
from acx4lib.georeferencing.validation import Differences, Prediction, Validation
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import correlation, sigmas
from acx4lib.synthetic_image.transferred_points import TransferredPoints

NO_ADJUSTMENT: Mapping[str, object] = dict.fromkeys(
    (
        *("n_observations", "n_unknowns", "redundancy", "sigma0_squared", "chi_square_p"),
        *("iterations", "n_rejected", "n_left_out"),
    )
)
"""Entries of summary.json for an adjustment that was not made or failed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """The results of one method, ready to be written.

    Attributes
    ----------
    stage, method : str
    tables : dict of str to DataFrame
        Tables by the names of `table_files.COLUMNS`.
    summary : dict
        Objects for summary.json, by their keys.
    """

    stage: str
    method: str
    tables: dict[str, pd.DataFrame]
    summary: dict[str, dict[str, object]] = field(default_factory=dict)


def write(
    folder: str | Path,
    stage: str,
    records: Iterable[Record],
    *,
    flight: Flight,
    calibration: Mapping[str, object] | None = None,
    methods: Sequence[str] = (),
) -> None:
    """Write the records of a stage in place of its old results.

    Parameters
    ----------
    folder : path
    stage : str
        All its old rows are removed, even those of methods without a new record.
    records : iterable of Record
    flight, calibration, methods
        As `provenance.write` takes them.

    Raises
    ------
    FlightError, OutputError
        As `provenance.write`.
    """
    records = list(records)
    names = {name for record in records for name in record.tables}
    tables = {name: [r.tables[name] for r in records if name in r.tables] for name in names}
    summary = {key: entry for record in records for key, entry in record.summary.items()}
    provenance.write(
        folder, stage, tables, summary, flight=flight, calibration=calibration, methods=methods
    )


# --- bundles ---------------------------------------------------------------------------------


def of_bundle(
    key: str,
    bundle: Bundle,
    calibration: Calibration,
    diagnosed: Mapping[str, object],
) -> Record:
    """Return the record of an adjusted bundle.

    Parameters
    ----------
    key : str
        Of its object in summary.json, which begins with stage and method.
    bundle : Bundle
    calibration : Calibration
        The cameras calibrated by the method.
    diagnosed : mapping of str to object
        What its diagnosis adds to the object.
    """
    stage, method = key.split("/")[:2]
    solution = bundle.solution
    entry: dict[str, object] = {
        "n_observations": solution.n_observations,
        "n_unknowns": solution.n_unknowns,
        "redundancy": solution.redundancy,
        "sigma0_squared": solution.sigma0_sq,
        "chi_square_p": solution.chi_square_p,
        "iterations": solution.iterations,
        "converged": True,
        "n_rejected": len(bundle.rejected),
        **stopped_entries(key, bundle.stopped),
        "n_left_out": sum(bundle.network.left_out.values()),
        "left_out_points": dict(bundle.network.left_out),
        **turns_entry(calibration.turns),
    }
    return Record(
        stage=stage,
        method=method,
        tables=bundle_tables(stage, method, bundle, calibration),
        summary={key: {**entry, **diagnosed}},
    )


def turns_entry(turns: Array | None) -> dict[str, object]:
    """Return the entry of summary.json on picture turns; empty without any."""
    return {} if turns is None else {"picture_turns_deg": np.degrees(turns).tolist()}


def stopped_entries(key: str, stopped: Sequence[Stopped]) -> dict[str, object]:
    """Return the entries of summary.json on groups with too many rejections, so none made."""
    return {
        "stopped": [f"{key}: {sentence(stopped)}"] if stopped else [],
        "stopped_groups": [[group.group, group.n_rejected, group.n] for group in stopped],
    }


def of_left_out(stage: str, method: str, reason: str) -> Record:
    """Return the record of a method that was left out, with the reason."""
    entry = {**NO_ADJUSTMENT, "converged": False, "left_out": [f"{stage}/{method}: {reason}"]}
    return Record(stage=stage, method=method, tables={}, summary={f"{stage}/{method}": entry})


def of_failure(stage: str, method: str, reason: str, *, summary_key: str) -> Record:
    """Return the record of an adjustment that failed, with the reason."""
    entry = {**NO_ADJUSTMENT, "converged": False, "not_determined": [reason]}
    return Record(stage=stage, method=method, tables={}, summary={summary_key: entry})


# --- relative orientation --------------------------------------------------------------------


def of_relative_orientation(
    stage: str, method: str, orientation: RelativeOrientation, **entries: object
) -> Record:
    """Return the record of heads oriented in the synthetic frame.

    Other keyword arguments become entries of the summary.
    """
    known = {"n_exposures": orientation.n_exposures, **turns_entry(orientation.turns)}
    entry = {**NO_ADJUSTMENT, "converged": True, **known, **entries}
    return Record(
        stage=stage,
        method=method,
        tables=orientation_tables(stage, method, orientation),
        summary={f"{stage}/{method}": entry},
    )


# --- Records of the validations for a results folder


MANY = 0.1
"""Share of rejected measurements above which these are not single gross errors."""


def of_validation(validation: Validation, entries: Mapping[str, object]) -> Record:
    """Return the record of one method's validation; `entries` are added to its summary."""
    method, block = validation.method, validation.block
    points = validation.points
    names = [block.points[block.check.point_idx[i]] for i in points.point_idx]
    cov = pose_covariances(block, validation.georeferenced)
    tables = {
        "validation": _pair_table(method, block, validation.pairs),
        "check_points": point_table(
            "validation", method, names, points.n_images, points.d, points.sigma
        ),
        "exterior_orientation": of_method(
            "validation",
            method,
            exterior_table(
                block, block.images.names, T_m_c=validation.georeferenced.T_m_c, cov=cov
            ),
        ),
        "rejected": rejected_table(
            "validation",
            method,
            replace(block, control=block.check, check=block.control),  # rejected are check points
            validation.rejected,
            pose_names=block.trajectory.exposures,
        ),
    }
    return Record(
        stage="validation",
        method=method,
        tables=tables,
        summary={f"validation/{method}": {**_validation_summary(validation), **entries}},
    )


def with_prediction(record: Record, found: Prediction | Failed) -> Record:
    """Add the prediction of exposures to a validation's record without check points.

    Parameters
    ----------
    record : Record
        Of a validation without check points.
    found : Prediction or Failed
    """
    ((key, entry),) = record.summary.items()
    entries: dict[str, object] = {}
    if isinstance(found, Prediction):
        entries, line = _prediction_summary(found), sentences.prediction(found)
    else:
        line = f"exposures are not predicted: {found.reason}"
    notes = [*results.messages(entry, "notes"), f"{key}: {line}"]
    return replace(record, summary={key: {**entry, **entries, "notes": notes}})


def _prediction_summary(prediction: Prediction) -> dict[str, object]:
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


def _pair_table(method: str, block: Block, pairs: Differences) -> pd.DataFrame:
    images = np.array(block.images.names, dtype=object)
    points = np.array(block.points, dtype=object)
    frame = pd.DataFrame(
        np.column_stack([pairs.d, pairs.sigma]),
        columns=list(COLUMNS["validation"][4:]),
    )
    frame.insert(0, "method", method)
    frame.insert(1, "point", points[block.check.point_idx[pairs.point_idx]])
    frame.insert(2, "image_a", images[pairs.image_idx[:, 0]])
    frame.insert(3, "image_b", images[pairs.image_idx[:, 1]])
    return frame


def _validation_summary(validation: Validation) -> dict[str, object]:
    over_pairs = accuracy.from_differences(validation.pairs.d)
    over_points = accuracy.from_differences(validation.points.d)
    survey = validation.block.check.sigma_m[validation.points.point_idx]
    survey_sigma = accuracy.triple(np.sqrt(np.mean(survey**2, axis=0)) if len(survey) else [0] * 3)
    return {
        "n_observations": validation.n_observations,
        "n_unknowns": 3 * len(validation.points),
        "redundancy": validation.redundancy,
        "sigma0_squared": validation.sigma0_sq,
        "chi_square_p": validation.chi_square_p,
        "joint_chi_square": validation.joint_chi_square,
        "joint_dof": validation.joint_dof,
        "joint_chi_square_p": validation.joint_chi_square_p,
        "iterations": 1,
        "converged": True,
        "n_rejected": len(validation.rejected),
        "expected_rejections": _expected_rejections(validation),
        **stopped_entries(f"validation/{validation.method}", validation.stopped),
        "n_left_out": validation.n_left_out,
        "n_pairs": len(validation.pairs),
        "n_failed_pairs": validation.n_failed,
        "n_points": len(validation.points),
        "height_offset_share": _height_offset(validation)[1],
        "notes": [
            f"validation/{validation.method}: {note}" for note in _notes_of_validation(validation)
        ],
        **_statistics(over_pairs),
        "points": {
            **_statistics(over_points),
            "mean_sigma": [*sigmas(validation.mean_cov)],
            **_spread(validation),
            "bias": _test(accuracy.bias_test(np.array(over_points.mean), validation.mean_cov)),
            "classes": accuracy.classes(over_points, survey_sigma=survey_sigma),
        },
    }


def _expected_rejections(validation: Validation) -> float:
    """Return the expected number of chance rejections: two components of rays, three or more."""
    n_images = validation.points.n_images
    return 2 * int(n_images[n_images > 2].sum()) * 2 * statistics.norm_sf(CRITICAL)


def _notes_of_validation(validation: Validation) -> Iterator[str]:
    """Yield warnings on many rejections and on a height offset of all check points."""
    n_rejected = sum(r.kind == "image_point" for r in validation.rejected)
    n_measured = n_rejected + validation.n_observations // 2
    if n_rejected > MANY * n_measured:
        yield (
            f"{n_rejected} of {n_measured} measurements of check points do not fit the others: "
            "rather a wrong calibration or trajectory than so many gross errors"
        )
    offset, share = _height_offset(validation)
    if abs(share) > LIMIT_SCALE:
        yield (
            f"the check points come out {abs(offset):.1f} m too {'high' if offset > 0 else 'low'}, "
            f"{100 * abs(share):.1f} % of the flying height: the height system of check "
            "points or trajectory, or the focal length, is wrong"
        )


def _height_offset(validation: Validation) -> tuple[float, float]:
    """Return the median height difference, m, and its share of the flying height."""
    if not len(validation.points):
        return 0.0, 0.0
    above = np.median(validation.georeferenced.T_m_c.r[:, 2]) - validation.block.check.x_m[:, 2]
    offset = float(np.median(validation.points.d[:, 2]))
    return offset, offset / float(np.median(above))


def _spread(validation: Validation) -> dict[str, object]:
    """Return the RMS of the normalised differences, and the effective number of points, by axis."""
    points = validation.points
    if not len(points):
        return {"normalised_rms": [np.nan] * 3, "effective_number": [np.nan] * 3}
    cov_axes = error_sources.axis_covariances(points.sources)
    return {
        "normalised_rms": list(np.sqrt(np.mean((points.d / points.sigma) ** 2, axis=0))),
        "effective_number": [accuracy.effective_number(correlation(cov)) for cov in cov_axes],
    }


def _statistics(measures: accuracy.Accuracy) -> dict[str, object]:
    return {"mean": list(measures.mean), "std": list(measures.std), "rms": list(measures.rms)}


def _test(test: accuracy.AxisTest) -> dict[str, object]:
    return {
        "statistic": list(test.statistic),
        "critical": test.critical,
        "accepted": list(test.accepted),
    }


# --- The table of points transferred into synthetic images


def of_transferred(flight: Flight, transferred: Mapping[str, TransferredPoints]) -> Record:
    """Return the record of the transferred points of all blocks.

    Parameters
    ----------
    flight : Flight
    transferred : mapping of str to TransferredPoints
        By block.
    """
    tables = [_table(flight.block(name), points) for name, points in transferred.items()]
    entry: dict[str, object] = {
        **NO_ADJUSTMENT,
        "converged": True,
        "n_observations": 2 * sum(map(len, transferred.values())),
        "n_left_out": sum(points.n_left_out for points in transferred.values()),
        "measured": {file: flight.sha256[file] for n in transferred for file in measured_files(n)},
    }
    return Record(
        stage="synthetic",
        method="points",
        tables={"synthetic_points": pd.concat(tables, ignore_index=True)},
        summary={METHOD: entry},
    )


def _table(block: Block, transferred: TransferredPoints) -> pd.DataFrame:
    heads = [camera.name for camera in block.cameras]
    return pd.DataFrame(
        {
            "block": block.name,
            "image": [block.trajectory.exposures[i] for i in transferred.exposure_idx],
            "point": [block.points[i] for i in transferred.point_idx],
            "head": [heads[i] for i in transferred.camera_idx],
            "col_px": transferred.colrow[:, 0],
            "row_px": transferred.colrow[:, 1],
            "sigma_col_px": transferred.sigma_px[:, 0],
            "sigma_row_px": transferred.sigma_px[:, 1],
        }
    )
