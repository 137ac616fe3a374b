"""The calibration report: a results folder as one page to be printed and filed.

Everything in it is read from the results of a run; nothing is adjusted again. `material` reads
them, `findings` asks the questions and `verdict` judges their tests at one level; `page` writes the
record as JSON, and its texts through two templates, ``report.html`` and ``report.typ``.
"""
