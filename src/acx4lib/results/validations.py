"""Records of the validations for a results folder."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from acx4lib.bundle.gross_errors.rejections import CRITICAL
from acx4lib.calibration.estimates import LIMIT_SCALE, TWO_STEP, Calibration
from acx4lib.flight.block import Block
from acx4lib.georeferencing import accuracy, error_sources, standards, weak
from acx4lib.georeferencing.differences import Differences
from acx4lib.georeferencing.direct import pose_covariances
from acx4lib.georeferencing.validation import Validation
from acx4lib.least_squares.covariance import correlation, sigmas
from acx4lib.least_squares.statistical import distributions
from acx4lib.results.adjustments import (
    Record,
    exchanged_entries,
    of_left_out,
    stopped_entries,
    weak_entries,
)
from acx4lib.results.files.table_files import COLUMNS
from acx4lib.results.rows import exterior_table, of_method, point_table, rejected_table

MANY = 0.1
"""Share of rejected measurements above which these are not single gross errors."""


def of_validations(
    validations: Sequence[Validation],
    calibrations: Mapping[str, Calibration] | None = None,
    features: frozenset[str] = frozenset(),
    *,
    late: bool = False,
) -> list[Record]:
    """Return the records of all validations; without any, one record with the reason.

    Parameters
    ----------
    validations : sequence of Validation
    calibrations : mapping of str to Calibration, optional
        What was validated, by method: of the single step and of rigs it is said which parameters
        have too much of the variance of check points.
    features : frozenset of str
        What the calibration's flight has, as `needs.features` returns it.
    late : bool
        Whether a delay of the positions was estimated with the calibration.
    """
    if not validations:
        reason = "no method has all its parameters determined"
        return [of_left_out("validation", "all", reason)]
    known = {name: c for name, c in (calibrations or {}).items() if name not in TWO_STEP}
    return [
        of_validation(validation, **_weak_entries(validation, known, features, late=late))
        for validation in validations
    ]


def _weak_entries(
    validation: Validation,
    calibrations: Mapping[str, Calibration],
    features: frozenset[str],
    *,
    late: bool,
) -> dict[str, object]:
    calibration = calibrations.get(validation.method)
    if calibration is None or validation.stopped:
        return {}
    shares = weak.shares(validation.points.sources, calibration)
    found = weak.of_calibration(calibration, shares)
    return weak_entries(f"validation/{validation.method}", found, features, late=late)


def of_validation(validation: Validation, **said: object) -> Record:
    """Return the record of one method's validation; keywords become entries of the summary."""
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
        summary={f"validation/{method}": {**_validation_summary(validation), **said}},
    )


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
        "expected_rejections": expected_rejections(validation),
        **stopped_entries(f"validation/{validation.method}", validation.stopped),
        **exchanged_entries(f"validation/{validation.method}", validation.exchanged),
        "n_left_out": validation.n_left_out,
        "n_pairs": len(validation.pairs),
        "n_failed_pairs": validation.n_failed,
        "n_points": len(validation.points),
        "height_offset_share": height_offset(validation)[1],
        "notes": [f"validation/{validation.method}: {note}" for note in _notes(validation)],
        **_statistics(over_pairs),
        "points": {
            **_statistics(over_points),
            "mean_sigma": [*sigmas(validation.mean_cov)],
            **_spread(validation),
            "bias": _test(accuracy.bias_test(np.array(over_points.mean), validation.mean_cov)),
            "classes": standards.classes(over_points, survey_sigma=survey_sigma),
        },
    }


def expected_rejections(validation: Validation) -> float:
    """Return how many measurements chance rejects: two components of rays of three or more."""
    n_images = validation.points.n_images
    return 2 * int(n_images[n_images > 2].sum()) * 2 * distributions.norm_sf(CRITICAL)


def _notes(validation: Validation) -> Iterator[str]:
    """Yield warnings for the user: many rejections have a cause that affects all points."""
    n_rejected = sum(r.kind == "image_point" for r in validation.rejected)
    n_measured = n_rejected + validation.n_observations // 2
    if n_rejected > MANY * n_measured:
        yield (
            f"{n_rejected} of {n_measured} measurements of check points do not fit the others: "
            "rather a wrong calibration or trajectory than so many gross errors"
        )
    off, share = height_offset(validation)
    if abs(share) > LIMIT_SCALE:
        yield (
            f"the check points come out {abs(off):.1f} m too {'high' if off > 0 else 'low'}, "
            f"{100 * abs(share):.1f} % of the flying height: the height system of check "
            "points or trajectory, or the focal length, is wrong"
        )


def height_offset(validation: Validation) -> tuple[float, float]:
    """Return the median height difference, m, and its share of the flying height."""
    if not len(validation.points):
        return 0.0, 0.0
    above = np.median(validation.georeferenced.T_m_c.r[:, 2]) - validation.block.check.x_m[:, 2]
    off = float(np.median(validation.points.d[:, 2]))
    return off, off / float(np.median(above))


def _spread(validation: Validation) -> dict[str, object]:
    """Return the RMS of the differences over their sigma, and how many it is as sure as."""
    points = validation.points
    if not len(points):
        return {"normalised_rms": [np.nan] * 3, "effective_number": [np.nan] * 3}
    among = error_sources.axis_covariances(points.sources)
    return {
        "normalised_rms": list(np.sqrt(np.mean((points.d / points.sigma) ** 2, axis=0))),
        "effective_number": [accuracy.effective_number(correlation(cov)) for cov in among],
    }


def _statistics(said: accuracy.Accuracy) -> dict[str, object]:
    return {"mean": list(said.mean), "std": list(said.std), "rms": list(said.rms)}


def _test(test: accuracy.AxisTest) -> dict[str, object]:
    return {
        "statistic": list(test.statistic),
        "critical": test.critical,
        "accepted": list(test.accepted),
    }
