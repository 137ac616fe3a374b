"""Records of the adjustments for a results folder, one for each method."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from acx4files.flight.reader import Flight
from acx4files.results import folder as results
from acx4files.results import provenance
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
from acx4lib.bundle.gross_errors import expected_failures
from acx4lib.bundle.rejections import CRITICAL, Stopped, sentence
from acx4lib.bundle.variance_components import (
    BOUNDS,
    Component,
    as_json,
    components,
    sentences,
    sigma_tests,
)
from acx4lib.calibration import (
    common_errors,
    determination,
    held,
    stability,
    trajectory_errors,
)
from acx4lib.calibration.confirmation import confirmations
from acx4lib.calibration.estimates import (
    LIMIT_SCALE,
    RIGS,
    SIGMAS_OF_SCALE,
    TWO_STEP,
    Calibration,
    features,
    from_bundle,
    not_determined,
    parameters,
    rough_boresights,
)
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.calibration.held import ONE_SIGMA, Held
from acx4lib.calibration.mounting import Mounting, Mountings
from acx4lib.expected import Array
from acx4lib.georeferencing import accuracy, error_sources, freed, weak
from acx4lib.georeferencing.direct import pose_covariances
from acx4lib.georeferencing.validation import Differences, Prediction, Validation
from acx4lib.georeferencing.weak import Weak
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import correlation, sigmas
from acx4lib.synthetic_image.transferred_points import TransferredPoints

MANY_REJECTED = 0.005
"""Share of rejected image points above which a user is warned; chance rejects 1/20 of it."""

NO_ADJUSTMENT: Mapping[str, object] = dict.fromkeys(
    (
        *("n_observations", "n_unknowns", "redundancy", "sigma0_squared", "chi_square_p"),
        *("iterations", "n_rejected", "n_left_out"),
    )
)
"""Entries of summary.json for an adjustment that was not made or failed."""

OPTIONAL = (*TWO_STEP, *RIGS)
"""Methods that need more than every flight has: if they fail, a run goes on."""


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
    stage: str,
    method: str,
    bundle: Bundle,
    *,
    calibration: Calibration | None = None,
    summary_key: str | None = None,
    applied: Mapping[str, float] | None = None,
    over_ground: bool = False,
) -> Record:
    """Return the record of an adjusted bundle.

    Parameters
    ----------
    stage, method : str
    bundle : Bundle
    calibration : Calibration, optional
        The cameras calibrated by the method; by default those of the bundle.
    summary_key : str, optional
        By default ``stage/method``.
    applied : mapping of str to float, optional
        Factors that were applied to the sigma of every group.
    over_ground : bool
        Whether to find every parameter's share of the variance of the ground under the format's
        corners, for a flight without check points.
    """
    calibrated = calibration or from_bundle(bundle)
    solution = bundle.solution
    key = summary_key or f"{stage}/{method}"
    open_lines = [
        *not_determined(calibrated, features(bundle.network.block)),
        *trajectory_errors.not_determined(bundle),
    ]
    # where a group contradicts the others, sigma0 and so all sigma are large for this reason
    unknown = [] if bundle.stopped else [f"{key}: {line}" for line in open_lines]
    sigma_components = components(bundle, applied=applied)
    # a held lever arm, or a group that contradicts the others, makes right sigma look wrong
    judged = () if method in TWO_STEP or bundle.stopped else sigma_components
    entry: dict[str, object] = {
        "n_observations": solution.n_observations,
        "n_unknowns": solution.n_unknowns,
        "redundancy": solution.redundancy,
        "sigma0_squared": solution.sigma0_sq,
        "chi_square_p": solution.chi_square_p,
        "iterations": solution.iterations,
        "converged": True,
        "n_rejected": len(bundle.rejected),
        "expected_rejections": expected_failures(bundle),
        **_stopped_entries(key, bundle.stopped),
        "n_left_out": sum(bundle.network.left_out.values()),
        "left_out_points": dict(bundle.network.left_out),
        **determination.as_json(bundle, calibrated),
        **_declared_entries(key, method, bundle),
        **_turns_entry(calibrated.turns),
        "boresight_stability": {} if bundle.stopped else stability.as_json(bundle),
        **_weak_entries(key, method, bundle, calibrated, over_ground=over_ground),
        "not_determined": unknown,
        "left_out": unknown if method in OPTIONAL else [],
        "sigma_factors": as_json(sigma_components),
        "sigma_tests": {
            test.group: {k: v for k, v in asdict(test).items() if k != "group"}
            for test in sigma_tests(bundle)
        },
        "sigma_beyond": [f"{key}: {line}" for line in _beyond(judged)],
        "height_scale_error": _height_scale(bundle) - 1,
        "height_scale_sigma": _focal_sigma(calibrated),
        "notes": [
            f"{key}: {line}" for line in (*_notes(method, bundle, calibrated), *sentences(judged))
        ],
    }
    return Record(
        stage=stage,
        method=method,
        tables=bundle_tables(stage, method, bundle, calibrated),
        summary={key: entry},
    )


def with_held(record: Record, tested: Held) -> Record:
    """Return the record of an adjustment with what it holds, tested.

    Moves of less than `ONE_SIGMA` are left out.
    """
    columns = (tested.value, tested.estimate, tested.sigma, tested.reduction, tested.p)
    names = ("value", "estimate", "sigma", "cost", "p")
    values: dict[str, dict[str, object]] = {}
    for name, moves, *row in zip(tested.names, tested.moves, *columns, strict=True):
        pairs = zip(tested.estimates, map(float, moves), strict=True)
        values[name] = {**dict(zip(names, map(float, row), strict=True))}
        values[name]["moves"] = {of: move for of, move in pairs if abs(move) >= ONE_SIGMA}
    entries = {"held": values, "held_p": tested.joint[2], "held_rejected": list(tested.rejected)}
    return replace(record, summary={k: {**of, **entries} for k, of in record.summary.items()})


def _turns_entry(turns: Array | None) -> dict[str, object]:
    """Return the entry of summary.json on picture turns; empty without any."""
    return {} if turns is None else {"picture_turns_deg": np.degrees(turns).tolist()}


def _beyond(sigma_components: Sequence[Component]) -> list[str]:
    """Return a sentence for each group whose sigma factor is too large or small to be plausible."""
    least, most = BOUNDS
    return [
        f"the sigma of {c.group} were multiplied by {c.applied:.3g}, outside {least:.2g} to "
        f"{most:g}: rather a mistake, in these observations or others, than another sigma; look "
        'at the residuals with weights = "given", or state the sigma that you can justify'
        for c in sigma_components
        if c.is_beyond
    ]


def _stopped_entries(key: str, stopped: Sequence[Stopped]) -> dict[str, object]:
    """Return the entries of summary.json on groups with too many rejections, so none made."""
    return {
        "stopped": [f"{key}: {sentence(stopped)}"] if stopped else [],
        "stopped_groups": [[group.group, group.n_rejected, group.n] for group in stopped],
    }


def _declared_entries(key: str, method: str, bundle: Bundle) -> dict[str, object]:
    """Return the entries of summary.json on declared mountings.

    None for two steps, whose bundle has no mountings, nor where the data contradict each other.
    """
    declared = [] if bundle.stopped or method in TWO_STEP else confirmations(bundle)
    return {
        "declared": {
            f"{c.camera}/{c.part.replace(' ', '_')}": {
                "difference": list(c.difference),
                "p": c.p,
                "confirmed": not c.objection,
                "told": c.statement,
                "mistake": c.mistake,
            }
            for c in declared
        },
        "not_confirmed": [f"{key}: {c.sentence}" for c in declared if c.objection],
        "approximations": [f"{key}: {c.remark}" for c in declared if c.remark],
    }


def _weak_entries(
    key: str, method: str, bundle: Bundle, calibration: Calibration, *, over_ground: bool
) -> dict[str, object]:
    """Return the entries of summary.json on weak parameters.

    None for heads one by one and for two steps, whose poses are not those of strips, nor where the
    data contradict each other.
    """
    if bundle.stopped or method not in ("single_step", *RIGS):
        return {}
    block = bundle.network.block
    weak_parameters = weak.of_bundle(bundle, calibration)
    if over_ground:
        shares = weak.shares_at_corners(calibration, block)
        weak_parameters += weak.of_calibration(calibration, shares, of=weak.CORNERS)
    late = bool(bundle.network.layout.delay[0] >= 0)
    return _entries_of_weak(key, weak.together(weak_parameters), features(block), late=late)


def _entries_of_weak(
    key: str,
    weak_parameters: Sequence[Weak],
    has: frozenset[str] = frozenset(),
    *,
    late: bool = False,
) -> dict[str, object]:
    """Return the entries of summary.json on weak parameters."""
    return {
        "weak": [f"{key}: {line}" for line in weak.sentences(weak_parameters, has, late=late)],
        "weak_parameters": {
            entry.parameter.full_name: {
                "sigma": entry.parameter.sigma,
                "share": entry.share,
                "calm_ratio": entry.calm,
            }
            for entry in weak_parameters
        },
    }


def _notes(method: str, bundle: Bundle, calibration: Calibration) -> list[str]:
    """Return warnings and remarks on an adjustment, one sentence each."""
    left_out = bundle.network.left_out.items()
    notes = [f"{n} tie point{'s' * (n > 1)} {reason} left out" for reason, n in left_out]
    of_sigma = (
        rough_boresights(calibration),
        common_errors.enlarged_sentence(calibration),
        common_errors.turned_sentence(calibration.turns),
    )
    notes += filter(None, (determination.beyond_precision(bundle), *of_sigma))
    n_measured = len(bundle.network.block.image_points)
    n_rejected = sum(r.kind == "image_point" for r in bundle.rejected)
    # the two-step methods take over the rejections of the single step, which has the note
    if n_rejected > MANY_REJECTED * n_measured and method not in TWO_STEP:
        notes.append(f"{n_rejected} of {n_measured} image points rejected: see rejected.csv")
    scale = _height_scale(bundle)
    if abs(scale - 1) > max(LIMIT_SCALE, SIGMAS_OF_SCALE * _focal_sigma(calibration)):
        notes.append(
            f"control and trajectory differ by {100 * abs(scale - 1):.1f} % in scale: the height "
            "system of control or trajectory, or the focal length in flight.toml, is wrong"
        )
    by_course = trajectory_errors.by_course(bundle)
    if by_course is not None and by_course.differs:
        notes.append(by_course.sentence)
    return [*notes, *trajectory_errors.notes(bundle)]


def _focal_sigma(calibration: Calibration) -> float:
    """Return the relative standard deviation of the first camera's focal length; 0 if held."""
    first = calibration.cameras[0]
    of_f = (p.sigma for p in parameters(calibration) if (p.camera, p.key) == (first.name, "f"))
    sigma = next(of_f, 0.0) / first.interior.f
    return float(sigma) if np.isfinite(sigma) else 0.0


def _height_scale(bundle: Bundle) -> float:
    """Return the ratio of the bundle's flying height over control to the trajectory's.

    One where control or trajectory give no height. The estimated focal length is part of the
    ratio: a wrong one changes free orientations, and observed orientations change it.
    """
    network = bundle.network
    control = network.control.x_m[:, 2]
    images = np.flatnonzero(bundle.oriented)
    if len(network.block.control) == 0 or len(control) == 0 or len(images) == 0:
        return 1.0
    declared = network.block.cameras[0].interior.f
    by_focal_length = bundle.state.interiors[0].f / declared
    ground = control.mean()
    observed = network.block.T_m_b_images.r[images, 2] - ground
    adjusted = bundle.T_m_c.r[images, 2] - ground
    scale = float(np.median(adjusted / observed))
    return scale if abs(scale - 1) > abs(by_focal_length - 1) else by_focal_length


def of_mounting(
    mounting: Mounting, *, applied: Mapping[str, float] | None = None, over_ground: bool = False
) -> Record:
    """Return the record of one method of the mounting stage; keywords as in `of_bundle`."""
    record = of_bundle(
        "mounting",
        mounting.method,
        mounting.bundle,
        calibration=mounting.calibration,
        applied=applied,
        over_ground=over_ground,
    )
    tested = held.of_mounting(mounting)
    record = with_held(record, tested)
    if mounting.by_bundle is not None or (moved := freed.on_ground(mounting, tested)) is None:
        return record
    ((key, entry),) = record.summary.items()
    effect = {
        "held_effect_m": moved.largest_m.tolist(),
        "held_effect_sigma": moved.largest_sigma.tolist(),
    }
    return replace(record, summary={key: {**entry, **effect}})


def of_mountings(
    mountings: Mountings,
    *,
    applied: Mapping[str, float] | None = None,
    over_ground: bool = False,
) -> list[Record]:
    """Return the records of all methods of the mounting stage, failures included.

    Keywords are those of `of_bundle`.
    """
    records = [
        of_mounting(m, applied=applied, over_ground=over_ground) for m in mountings.methods.values()
    ]
    for method, reason in mountings.failures.items():
        if method == "single_step":
            key = f"mounting/{method}"
            records.append(of_failure("mounting", method, f"{key}: {reason}", summary_key=key))
        else:
            records.append(of_left_out("mounting", method, reason))
    return records


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
    known = {"n_exposures": orientation.n_exposures, **_turns_entry(orientation.turns)}
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
        The validated calibrations, by method. For the single step and rigs the record names
        parameters with too large a share of the variance of check points.
    features : frozenset of str
        Features of the calibration's flight, as `estimates.features` returns them.
    late : bool
        Whether a delay of the positions was estimated with the calibration.
    """
    if not validations:
        reason = "no method has all its parameters determined"
        return [of_left_out("validation", "all", reason)]
    known = {name: c for name, c in (calibrations or {}).items() if name not in TWO_STEP}
    return [
        _of_validation(
            validation, **_weak_entries_of_validation(validation, known, features, late=late)
        )
        for validation in validations
    ]


def _weak_entries_of_validation(
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
    weak_parameters = weak.of_calibration(calibration, shares)
    return _entries_of_weak(f"validation/{validation.method}", weak_parameters, features, late=late)


def _of_validation(validation: Validation, **entries: object) -> Record:
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
        entries, line = _prediction_summary(found), found.sentence
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
        **_stopped_entries(f"validation/{validation.method}", validation.stopped),
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
