"""Adjustments with their diagnosis: what summary.json tells of them, in numbers and sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np

from acx4files.results import sentences, tables
from acx4files.results.folder import Record
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.variance_components import BOUNDS, Component
from acx4lib.calibration import diagnosis, held
from acx4lib.calibration.determination import interior_exterior, largest_pairs
from acx4lib.calibration.diagnosis import Diagnosis, Weak
from acx4lib.calibration.estimates import (
    LIMIT_SCALE,
    RIGS,
    SIGMAS_OF_SCALE,
    TWO_STEP,
    Calibration,
)
from acx4lib.calibration.held import ONE_SIGMA, Held
from acx4lib.calibration.mounting import Mounting, Mountings
from acx4lib.calibration.stability import Turns
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.validation import Validation

MANY_REJECTED = 0.005
"""Share of rejected image points above which a user is warned; chance rejects 1/20 of it."""

OPTIONAL = (*TWO_STEP, *RIGS)
"""Methods that need more than every flight has: if they fail, a run goes on."""


# --- records ---------------------------------------------------------------------------------


def of_head(name: str, bundle: Bundle) -> Record:
    """Return the record of a head that was adjusted by itself."""
    key, of_bundle = f"heads/bundle/{name}", diagnosis.of(bundle)
    entry = {
        **_entries(key, "bundle", of_bundle),
        **_held_entries(held.of_bundle(bundle)),
        "largest_correlations": {**largest_pairs(interior_exterior(bundle))},
    }
    return tables.of_bundle(key, bundle, of_bundle.calibration, entry)


def of_mounting(
    mounting: Mounting, *, applied: Mapping[str, float] | None = None, over_ground: bool = False
) -> Record:
    """Return the record of one method of the mounting stage.

    Parameters
    ----------
    mounting : Mounting
    applied : mapping of str to float, optional
        Factors that were applied to the sigma of every group.
    over_ground : bool
        Whether to find every parameter's share of the variance of the ground under the format's
        corners, for a flight without check points.
    """
    key = f"mounting/{mounting.method}"
    found = diagnosis.of(mounting.bundle, mounting.calibration, applied=applied)
    tested = held.of_mounting(mounting)
    entry = {
        **_entries(key, mounting.method, found),
        **_weak_entries(key, mounting.method, found, over_ground=over_ground),
        **_held_entries(tested),
    }
    moved = budget.displacement(mounting, tested) if mounting.by_bundle is None else None
    if moved is not None:
        d, sigma = moved
        entry["held_effect_m"] = np.abs(d).max(axis=0).tolist()
        entry["held_effect_sigma"] = np.abs(d / sigma).max(axis=0).tolist()
    return tables.of_bundle(key, mounting.bundle, mounting.calibration, entry)


def of_mountings(
    mountings: Mountings,
    *,
    applied: Mapping[str, float] | None = None,
    over_ground: bool = False,
) -> list[Record]:
    """Return the records of all methods of the mounting stage, failures included.

    Keywords are those of `of_mounting`.
    """
    records = [
        of_mounting(m, applied=applied, over_ground=over_ground) for m in mountings.methods.values()
    ]
    for method, reason in mountings.failures.items():
        of = "not_determined" if method == "single_step" else "left_out"
        records.append(tables.not_adjusted(f"mounting/{method}", reason, of=of))
    return records


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
        return [tables.not_adjusted("validation/all", reason)]
    records = []
    for validation in validations:
        entry: dict[str, object] = {}
        calibration = (calibrations or {}).get(validation.method)
        if calibration and validation.method not in TWO_STEP and not validation.stopped:
            shares = budget.parameter_shares(validation.points.sources, calibration)
            found = diagnosis.of_shares(calibration, shares)
            key = f"validation/{validation.method}"
            entry = _entries_of_weak(key, found, features, late=late)
        records.append(tables.of_validation(validation, entry))
    return records


# --- entries of summary.json -----------------------------------------------------------------


def _entries(key: str, method: str, found: Diagnosis) -> dict[str, object]:
    """Return what a diagnosis adds to the object of a bundle."""
    bundle, calibration = found.bundle, found.calibration
    # where a group contradicts the others, sigma0 and so all sigma are large for this reason
    unknown = [
        f"{key}: {line}"
        for line in (
            *sentences.not_determined(calibration, found.features),
            *sentences.trajectory_not_determined(bundle),
        )
        if not bundle.stopped
    ]
    # a held lever arm, or a group that contradicts the others, makes right sigma look wrong
    judged = () if method in TWO_STEP or bundle.stopped else found.components
    notes = (*_notes(method, found), *sentences.sigmas(judged))
    return {
        "expected_rejections": found.expected_rejections,
        "condition": bundle.solution.condition,
        "weakest": {part.unknown: part.share for part in found.weakest},
        "correlated": [[pair.row, pair.column, pair.correlation] for pair in found.correlated],
        **_declared_entries(key, method, found),
        "boresight_stability": {}
        if bundle.stopped
        else {"strips": _turns(found.between_strips), "drift": _turns(found.over_time)},
        "not_determined": unknown,
        "left_out": unknown if method in OPTIONAL else [],
        "sigma_factors": {
            c.group: {
                "factor": c.factor if c.estimable else None,
                "sigma": c.sigma if c.estimable else None,
                "applied": c.applied,
                "redundancy": c.redundancy,
                "effective_redundancy": c.effective,
            }
            for c in found.components
        },
        "sigma_tests": {
            test.group: {k: v for k, v in asdict(test).items() if k != "group"}
            for test in found.sigma_tests
        },
        "sigma_beyond": [f"{key}: {line}" for line in _beyond(judged)],
        "height_scale_error": found.height_scale - 1,
        "height_scale_sigma": found.focal_sigma,
        "notes": [f"{key}: {line}" for line in notes],
    }


def _declared_entries(key: str, method: str, found: Diagnosis) -> dict[str, object]:
    """Return the entries on declared mountings; none of two steps, or where data contradict."""
    declared = () if found.bundle.stopped or method in TWO_STEP else found.confirmations
    return {
        "declared": {
            f"{c.camera}/{c.part.replace(' ', '_')}": {
                "difference": np.where(c.declared, c.difference, np.nan).tolist(),
                "p": c.p,
                "confirmed": c.confirmed,
                "told": sentences.difference(c),
                "mistake": sentences.mistake(c),
            }
            for c in declared
        },
        "not_confirmed": [
            f"{key}: {sentences.not_confirmed(c)}" for c in declared if not c.confirmed
        ],
        "approximations": [
            f"{key}: {line}" for c in declared if (line := sentences.approximation(c))
        ],
    }


def _turns(turns: Turns | None) -> dict[str, object] | None:
    """Return a test of the boresight's stability, angles in degrees."""
    if turns is None:
        return None
    return {
        "names": list(turns.names),
        "turns_deg": np.degrees(turns.turns).tolist(),
        "sigma_deg": np.degrees(turns.sigma).tolist(),
        "f": turns.f,
        "dof": turns.dof,
        "redundancy": turns.redundancy,
        "p": turns.p,
    }


def _weak_entries(
    key: str, method: str, found: Diagnosis, *, over_ground: bool
) -> dict[str, object]:
    """Return the entries on weak parameters.

    None for two steps, whose poses are not those of strips, nor where the data contradict.
    """
    bundle, calibration = found.bundle, found.calibration
    if bundle.stopped or method in TWO_STEP:
        return {}
    block = bundle.network.block
    shares = budget.shares_at_corners(calibration, block) if over_ground else None
    late = bool(bundle.network.layout.delay[0] >= 0)
    return _entries_of_weak(key, found.weak(shares), found.features, late=late)


def _entries_of_weak(
    key: str, weak_parameters: Sequence[Weak], has: frozenset[str], *, late: bool
) -> dict[str, object]:
    return {
        "weak": [f"{key}: {line}" for line in sentences.weak(weak_parameters, has, late=late)],
        "weak_parameters": {
            entry.parameter.full_name: {
                "sigma": entry.parameter.sigma,
                "share": entry.share,
                "calm_ratio": entry.calm,
            }
            for entry in weak_parameters
        },
    }


def _held_entries(tested: Held) -> dict[str, object]:
    """Return the entries on held parameters; moves of less than `ONE_SIGMA` are left out."""
    columns = (tested.value, tested.estimate, tested.sigma, tested.reduction, tested.p)
    names = ("value", "estimate", "sigma", "cost", "p")
    values: dict[str, dict[str, object]] = {}
    for name, moves, *row in zip(tested.names, tested.moves, *columns, strict=True):
        pairs = zip(tested.estimates, map(float, moves), strict=True)
        values[name] = {**dict(zip(names, map(float, row), strict=True))}
        values[name]["moves"] = {of: move for of, move in pairs if abs(move) >= ONE_SIGMA}
    return {"held": values, "held_p": tested.joint[2], "held_rejected": list(tested.rejected)}


# --- sentences -------------------------------------------------------------------------------


def _beyond(components: Sequence[Component]) -> list[str]:
    """Return a sentence for each group whose sigma factor is too large or small to be plausible."""
    least, most = BOUNDS
    return [
        f"the sigma of {c.group} were multiplied by {c.applied:.3g}, outside {least:.2g} to "
        f"{most:g}: rather a mistake, in these observations or others, than another sigma; look "
        'at the residuals with weights = "given", or state the sigma that you can justify'
        for c in components
        if c.is_beyond
    ]


def _notes(method: str, found: Diagnosis) -> list[str]:
    """Return warnings and remarks on an adjustment, one sentence each."""
    bundle, calibration = found.bundle, found.calibration
    left_out = bundle.network.left_out.items()
    notes = [f"{n} tie point{'s' * (n > 1)} {reason} left out" for reason, n in left_out]
    of_sigma = (
        sentences.rough_boresights(calibration),
        sentences.enlarged(calibration),
        sentences.turned(calibration.turns),
    )
    notes += filter(None, (sentences.beyond_precision(bundle), *of_sigma))
    n_measured = len(bundle.network.block.image_points)
    n_rejected = sum(r.kind == "image_point" for r in bundle.rejected)
    # the two-step methods take over the rejections of the single step, which has the note
    if n_rejected > MANY_REJECTED * n_measured and method not in TWO_STEP:
        notes.append(f"{n_rejected} of {n_measured} image points rejected: see rejected.csv")
    error = abs(found.height_scale - 1)
    if error > max(LIMIT_SCALE, SIGMAS_OF_SCALE * found.focal_sigma):
        notes.append(
            f"control and trajectory differ by {100 * error:.1f} % in scale: the height "
            "system of control or trajectory, or the focal length in flight.toml, is wrong"
        )
    by_course = found.by_course
    if by_course is not None and by_course.differs:
        notes.append(sentences.by_course(by_course))
    return [*notes, *sentences.on_trajectory(bundle)]
