"""The look of numbers, names, tables and figures.

`labels` names methods, parameters and units; `myst` makes tables of them, `style` figures.
`maps`, `matrix` and `pictures` are parts that several figures share. Text of a flight passes
`plain_text` on its way to a page, a figure or a terminal, so that none of it is interpreted. Begin
with `myst`.
"""
