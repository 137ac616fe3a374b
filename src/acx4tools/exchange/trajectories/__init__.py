"""Trajectories and lists of orientations, as rows of trajectory.csv, and tables of points.

`sbet` takes a trajectory of POSPac at the times of events; `times` knows these and the time bases.
`orientation_table` reads a text with declared columns, `applanix_text` one whose heading declares
them, `point_tables` measured and surveyed points: `listed` knows the words and the rows,
`orientations` turns them into the forms that a flight has.
"""
