"""The calibration report: a results folder as a document to be printed and filed (chapter 7).

Everything in it is read from the results of a run; nothing is adjusted again. `material` reads
them; `verdict` says what holds and what does not, `identity` who calibrated what and how. Then
follow the rooms of the other sections: `adjustment`, `parameters`, `mounting`, `ground`. The
notebook 07-report puts the parts in order, and `page` makes one file of it. Begin with `material`.
"""
