"""The look of numbers, names, tables and figures.

`myst` has tables, sentences, and names of methods, parameters and units; `style` has the look of
figures. `maps`, `matrix` and `pictures` are parts that several figures share. Text of a flight
passes `plain_text` on its way to a page, a figure or a terminal, so that none of it is interpreted.
Begin with `myst`.
"""
