"""Chapter 16, the error budget: where the error of a map comes from.

`examined` flies and calibrates the design acx4-ideal and splits the predicted errors of its check
points. `heights` does the same for mapping flights at many heights, `as_printed` with what the
paper says of its own flight. `tables`, `sentences`, `figures`, `explorer` and `exercises` show it.
Begin with `examined`.
"""
