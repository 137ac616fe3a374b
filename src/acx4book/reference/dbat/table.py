"""The comparison of DBAT's reports with our adjustments, line by line."""

from __future__ import annotations

import pandas as pd

from acx4book.reference.dbat import comparison, misfits, statements, surveyed
from acx4book.reference.dbat import printed as dbat_report
from acx4book.reference.dbat.blocks import Project


def results(project: Project) -> pd.DataFrame:
    """Return every number and statement of a report's results with ours.

    Parameters
    ----------
    project : Project

    Returns
    -------
    DataFrame
        As `comparison.compare` returns it.
    """
    lines = dbat_report.read(project.report)
    printed = {place: line for place, line in lines.items() if statements.is_result(place)}
    ours = {
        **statements.statements(project),
        **misfits.statements(project),
        **surveyed.statements(project),
    }
    return comparison.compare(printed, ours)
