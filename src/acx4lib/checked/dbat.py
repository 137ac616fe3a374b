"""Two adjustments of another program, compared with its reports line by line."""

from __future__ import annotations

import pandas as pd

from acx4lib.checked import comparison, dbat_quality, dbat_statements, dbat_surveyed
from acx4lib.checked.dbat_blocks import Project
from acx4lib.formats import dbat_report


def results(project: Project) -> pd.DataFrame:
    """Return every number and statement of a report's results beside ours.

    Parameters
    ----------
    project : Project

    Returns
    -------
    DataFrame
        As `comparison.compare` returns it.
    """
    lines = dbat_report.read(project.report)
    printed = {place: line for place, line in lines.items() if dbat_statements.is_result(place)}
    ours = {
        **dbat_statements.statements(project),
        **dbat_quality.statements(project),
        **dbat_surveyed.statements(project),
    }
    return comparison.compare(printed, ours)
