"""The page on the certificate of a run, which leads to the report itself."""

from __future__ import annotations

from acx4book.report import verdict
from acx4book.report.material import Material
from acx4book.typesetting.myst import myst_table


def page(run: Material, report: str) -> str:
    """Return the statement, the report's address and the findings, as MyST text below the title.

    Parameters
    ----------
    run : Material
    report : str
        Address of the report beside the page; the same as JSON has the ending .json.
    """
    found = verdict.findings(run)
    json = f"{report.removesuffix('.html')}.json"
    return "\n\n".join(
        [
            "*Can this calibration be used?*",
            verdict.statement(found),
            f'<a href="{report}">Open the report</a>, one file to print and to keep. Beside it '
            f'lies the same as <a href="{json}">JSON</a>.',
            myst_table(verdict.verdict_table(found), "Findings", name="tab-findings"),
            "",
        ]
    )
