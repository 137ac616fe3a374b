"""Chapter 3, the mounting: interior orientation, boresight, lever arm (section 4.2, Table 3).

`tables`, `sentences`, `weights`, `absorbed` and `figures` show the stage `mounting`;
`determination` and `reliability` say what the block determines and controls. `variants` and
`bad_starts` are trials: parts of the flight left out, wrong assumptions, starts far from the truth.
"""
