"""Chapter 1, the heads: interior and relative orientation (section 4.1, Table 1).

`tables`, `sentences` and `figures` show the stage `heads`; `held_focal_length` and `figure_held`
what would be seen if a focal length were wrong.
"""
