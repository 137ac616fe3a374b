"""Chapter 18, over the years: whether a camera has changed, and whether a rig is rigid.

`history` has six simulated campaigns of one camera, `chance` counts false alarms, `turned` is a rig
with one head that turned; `figures` and `sentences` show them. `exercises` has the solutions. Begin
with `history`.
"""
