"""Errata of the paper: 22 places where its numbers, units or words disagree.

Every number of a finding is computed from the transcribed tables (`acx4book.paper.printed`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import pandas as pd

from acx4book.paper.errata import agreements as agreeing
from acx4book.paper.errata import heads, mounting, text, validation
from acx4book.typesetting.myst import marked
from acx4lib.results import folder


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One discrepancy inside the paper.

    Attributes
    ----------
    number : int
        1 to 22.
    place : str
        Place in the paper.
    printed, computed, verdict : str
        What is printed, what follows from the paper's own numbers, and our conclusion.
    """

    number: int
    place: str
    printed: str
    computed: str
    verdict: str


Check = Callable[[], tuple[str, str, str]]

CHECKS: dict[int, tuple[str, Check]] = {
    1: ("eq. (2)", text.y_equation),
    2: ("before eq. (14)", text.equation_number),
    3: ("Table 3", mounting.exponents),
    4: ("Tables 1 and 3", text.units),
    5: ("Table 4", validation.rms_and_sigma),
    6: ("Table 4", validation.small_errors),
    7: ("2.1, 3.1, Table 1", heads.focal_length),
    8: ("Table 1", heads.missing_digit),
    9: ("4.1, Table 3", mounting.synthetic_distortion),
    10: ("4.1, Table 1", heads.border_distortion),
    12: ("Table 3", mounting.angle_sigmas),
    13: ("Tables 1 and 3", mounting.variance_factors),
    14: ("Table 3", mounting.lever_arm),
    15: ("Table 3", mounting.phi_difference),
    16: ("Table 1", heads.reference_camera),
    17: ("Tables 1 and 2", heads.coverage),
    18: ("abstract, Table 4", validation.headline),
    19: ("2.2, 3.2", text.one_direction),
    20: ("4.3", validation.map_scales),
    21: ("3.1, Table 4", validation.error_budget),
    22: ("throughout", text.wording),
}
"""Place and check by number; `audit` adds number 11, which needs a run."""


def audit(largest_correlations: Mapping[str, float] | None = None) -> list[Finding]:
    """Check the paper against itself.

    Parameters
    ----------
    largest_correlations : mapping, optional
        Largest correlations between interior and exterior orientation in a run of the heads,
        for item 11, by a name such as ``CAM1 xp_mm/omega_deg``.

    Returns
    -------
    list of Finding
        In the order of their numbers.
    """

    def correlations() -> tuple[str, str, str]:
        return heads.correlations(largest_correlations)

    checks = {**CHECKS, 11: ("4.1", correlations)}
    return [_finding(number, *checks[number]) for number in sorted(checks)]


def _finding(number: int, place: str, check: Check) -> Finding:
    printed, computed, verdict = check()
    return Finding(number=number, place=place, printed=printed, computed=computed, verdict=verdict)


def table(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return findings as a table: number, place, printed, computed, verdict."""
    columns = [*Finding.__dataclass_fields__]
    return marked(pd.DataFrame([asdict(finding) for finding in findings], columns=columns))


def agreements() -> pd.DataFrame:
    """Return the checks that agree: place, printed, computed."""
    rows = [check() for check in agreeing.CHECKS]
    return marked(pd.DataFrame(rows, columns=["place", "printed", "computed"]))


def largest_correlations(results_path: str | Path) -> dict[str, float]:
    """Read the largest interior-exterior correlations of a run's heads, for `audit`.

    Parameters
    ----------
    results_path : path
        Results folder; '' for none.

    Returns
    -------
    dict
        By names such as ``CAM1 xp_mm/omega_deg``, from the optional object
        ``largest_correlations`` of ``heads/bundle/...`` in summary.json. Empty without any.

    Raises
    ------
    FlightError
        Where there is no such folder.
    """
    if not str(results_path):
        return {}
    stage = "heads/bundle/"
    return {
        f"{name.removeprefix(stage)} {pair}": float(correlation)
        for name, entry in folder.read(results_path).summary.items()
        if name.startswith(stage) and isinstance(pairs := entry.get("largest_correlations"), dict)
        for pair, correlation in pairs.items()
    }
