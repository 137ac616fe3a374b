"""Chapter 3, the mounting: interior orientation, boresight, lever arm (section 4.2, Table 3).

`tables`, `sentences`, `weights`, `absorbed` and `figures` show the stage `mounting`;
`determination` and `reliability` say what the block determines and controls. `variants`
are trials: parts of the flight left out, and wrong assumptions.
"""
