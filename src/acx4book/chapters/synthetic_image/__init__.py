"""Chapter 2, the synthetic image: tie points, refinement, pixels (section 2.1, Table 2).

`tables`, `sentences` and `figures` show the stage `synthetic`; `equalised` the heads before and
after they are made equally bright; `parallax` and `wrong_heads` are trials: what the distance
between lenses does, and what refinements make of wrong heads.
"""
