"""Trajectories and lists of orientations, as rows of trajectory.csv, and tables of points.

`sbet` takes a trajectory of POSPac at the times of events. `orientations` reads a text with
declared columns, or one of Applanix whose heading declares them, in any of the forms that a flight
has, and measured and surveyed points; `listed` knows the words and the rows.
"""
