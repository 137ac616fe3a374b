"""The calibration report: a results folder as a document to be printed and filed.

Everything in it is read from the results of a run; nothing is adjusted again. `material` reads
them; `findings` says what holds and what does not, `identity` who calibrated what and how. Then
follow the other sections: `adjustment`, `parameters`, `mounting`, `ground`. The file
``report.md`` has the text with the parts in order, and `page` makes one file of it. Begin
with `material`.
"""
