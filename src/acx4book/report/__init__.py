"""The calibration report: a results folder as a document to be printed and filed.

Everything in it is read from the results of a run; nothing is adjusted again. The notebook
07-report puts the parts in order, `write` makes one file of it.
"""

from acx4book.report.describe import data_table, files, identification, mapped, method
from acx4book.report.material import Material, image_residuals, read, residuals
from acx4book.report.page.page import write
from acx4book.report.sections import (
    check_table,
    class_table,
    correlation_sentence,
    drift_table,
    group_table,
    head_table,
    method_table,
    parameter_table,
    rejected_sentence,
    rejected_table,
    reliability_table,
    test_table,
    verdict_table,
)
from acx4book.report.shown import correlation_picture, planes, show, table
from acx4book.report.stability import boresights, drifts
from acx4book.report.verdict import checked_points, findings, statement

__all__ = [
    "Material",
    "boresights",
    "check_table",
    "checked_points",
    "class_table",
    "correlation_picture",
    "correlation_sentence",
    "data_table",
    "drift_table",
    "drifts",
    "files",
    "findings",
    "group_table",
    "head_table",
    "identification",
    "image_residuals",
    "mapped",
    "method",
    "method_table",
    "parameter_table",
    "planes",
    "read",
    "rejected_sentence",
    "rejected_table",
    "reliability_table",
    "residuals",
    "show",
    "statement",
    "table",
    "test_table",
    "verdict_table",
    "write",
]
