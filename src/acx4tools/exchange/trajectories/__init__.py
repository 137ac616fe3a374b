"""Trajectories and lists of orientations, as rows of trajectory.csv.

`pospac` takes an SBET at the times of events: `sbet` reads the records, `events` the list, `times`
knows the time bases, `interpolation` what lies between two records. `orientation_table` reads a
text with declared columns, `applanix_text` one whose heading declares them: `columns` knows the
words, `listed` the rows, `orientations` turns them into the forms that a flight has.
"""
