"""Errata of the paper: 22 findings on how its numbers, units and words go together.

Every number of a finding is computed from the transcribed tables (`acx4book.paper.printed`);
three findings say more with the results of a run.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.paper import absorbed, printed
from acx4book.paper.errata import agreements as agreeing
from acx4book.paper.errata import heads, mounting, text, validation
from acx4book.typesetting.myst import marked
from acx4lib.calibration.absorption import Absorption
from acx4lib.expected import Array
from acx4lib.flight.reader import read_kept
from acx4lib.results import agreement, folder
from acx4lib.results.provenance import KEPT

MISPRINT, CONTRADICTION, OPEN, CONSISTENT = "misprint", "contradiction", "open", "consistent"
"""Kinds of findings. Open is what the paper does not tell or explain."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One finding on the paper.

    Attributes
    ----------
    number : int
        1 to 22.
    kind : str
        `MISPRINT`, `CONTRADICTION`, `OPEN` or `CONSISTENT`.
    place : str
        Place in the paper.
    printed, computed, verdict : str
        What is printed, what follows from the paper's own numbers, and our conclusion.
    """

    number: int
    kind: str
    place: str
    printed: str
    computed: str
    verdict: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """What findings take from a run; without one they say less.

    Attributes
    ----------
    correlations : mapping of str to float
        Largest correlations between interior and exterior orientation of the heads, by names
        such as ``CAM1 xp_mm/omega_deg``; for item 11.
    absorbed : Absorption, optional
        What interior orientation takes up of a lever arm; for item 14.
    predicted_m : ndarray, shape (3,), optional
        RMS in east, north, height that is predicted over all pairs; for item 21.
    """

    correlations: Mapping[str, float] = field(default_factory=dict)
    absorbed: Absorption | None = None
    predicted_m: Array | None = None


Check = Callable[[], tuple[str, str, str]]


def _checks(run: Run) -> dict[int, tuple[str, str, Check]]:
    """Return kind, place and check by number."""
    return {
        1: (MISPRINT, "eq. (2)", text.y_equation),
        2: (MISPRINT, "before eq. (14)", text.equation_number),
        3: (MISPRINT, "Table 3", mounting.exponents),
        4: (MISPRINT, "Tables 1 and 3", text.units),
        5: (CONTRADICTION, "Table 4", validation.rms_and_sigma),
        6: (CONTRADICTION, "Table 4", validation.small_errors),
        7: (CONTRADICTION, "2.1, 3.1, Tables 1 and 3", heads.focal_length),
        8: (MISPRINT, "Table 1", heads.missing_digit),
        9: (CONTRADICTION, "4.1, Table 3", mounting.synthetic_distortion),
        10: (CONSISTENT, "4.1, Table 1", heads.border_distortion),
        11: (OPEN, "4.1", partial(heads.correlations, run.correlations)),
        12: (OPEN, "Table 3", mounting.angle_sigmas),
        13: (OPEN, "Tables 1 and 3", mounting.variance_factors),
        14: (CONSISTENT, "Table 3", partial(mounting.lever_arm, run.absorbed)),
        15: (OPEN, "Table 3", mounting.phi_difference),
        16: (OPEN, "Table 1", heads.reference_camera),
        17: (CONSISTENT, "Tables 1 and 2", heads.coverage),
        18: (CONTRADICTION, "abstract, Table 4", validation.headline),
        19: (OPEN, "2.2, 3.2", text.one_direction),
        20: (OPEN, "4.3", validation.map_scales),
        21: (OPEN, "3.1, Table 4", partial(validation.error_budget, run.predicted_m)),
        22: (MISPRINT, "throughout", text.wording),
    }


def audit(run: Run = Run()) -> list[Finding]:
    """Check the paper against itself.

    Parameters
    ----------
    run : Run
        As `read_run` returns it; by default there is none.

    Returns
    -------
    list of Finding
        In the order of their numbers.
    """
    found = []
    for number, (kind, place, check) in _checks(run).items():
        said = dict(zip(("printed", "computed", "verdict"), check(), strict=True))
        found.append(Finding(number=number, kind=kind, place=place, **said))
    return found


def errata(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return what is misprinted, contradictory or open: a table of the findings, kind by kind."""
    kinds = (CONTRADICTION, OPEN, MISPRINT)
    wrong = [finding for finding in findings if finding.kind in kinds]
    return table(sorted(wrong, key=lambda finding: kinds.index(finding.kind)))


def consistent(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return the findings that the paper's numbers agree, as a table."""
    return table([finding for finding in findings if finding.kind == CONSISTENT])


def table(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return findings as a table: number, kind, place, printed, computed, verdict."""
    columns = [*Finding.__dataclass_fields__]
    return marked(pd.DataFrame([asdict(finding) for finding in findings], columns=columns))


def agreements() -> pd.DataFrame:
    """Return the checks that agree: place, printed, computed."""
    rows = [check() for check in agreeing.CHECKS]
    return marked(pd.DataFrame(rows, columns=["place", "printed", "computed"]))


def answer(findings: Sequence[Finding]) -> str:
    """Return sentences on how many findings of each kind there are, and where numbers disagree."""
    n = Counter(finding.kind for finding in findings)
    against = dict.fromkeys(f.place for f in findings if f.kind == CONTRADICTION)
    return (
        f"Mostly. Of {len(findings)} findings {n[CONTRADICTION]} are contradictions between "
        f"printed numbers (sections and tables: {'; '.join(against)}). {n[OPEN]} questions are "
        f"open, {n[MISPRINT]} findings are misprints, and {n[CONSISTENT]} that looked like errors "
        f"are consistent. {len(agreeing.CHECKS)} further checks find nothing wrong."
    )


def read_run(results_path: str | Path) -> Run:
    """Read what findings take from a run.

    Parameters
    ----------
    results_path : path
        Results folder; '' for none.

    Raises
    ------
    FlightError
        Where there is no such folder.
    """
    if not str(results_path):
        return Run()
    kept = Path(results_path) / KEPT
    if not kept.is_dir():
        return Run(correlations=_largest_correlations(folder.read(results_path)))
    flight = read_kept(kept)
    found = agreement.read(results_path, flight)
    if not printed.applies(flight):
        return Run(correlations=_largest_correlations(found))
    return Run(
        correlations=_largest_correlations(found),
        absorbed=absorbed.of_run(flight, found),
        predicted_m=_predicted(found),
    )


def _largest_correlations(found: folder.Results) -> dict[str, float]:
    """Return the optional objects ``largest_correlations`` of ``heads/bundle/...``."""
    stage = "heads/bundle/"
    return {
        f"{name.removeprefix(stage)} {pair}": float(correlation)
        for name, entry in found.summary.items()
        if name.startswith(stage) and isinstance(pairs := entry.get("largest_correlations"), dict)
        for pair, correlation in pairs.items()
    }


def _predicted(found: folder.Results) -> Array | None:
    """Return the RMS that is predicted over all pairs of the single step; None without any."""
    if "validation/single_step" not in found.summary:
        return None
    pairs = folder.rows(found, "validation", "validation/single_step")
    sigma = pairs[["sigma_east_m", "sigma_north_m", "sigma_height_m"]].to_numpy(dtype=float)
    return np.sqrt(np.mean(sigma**2, axis=0)) if len(sigma) else None
