"""Figures that readers move: drawings with sliders, and the block in space.

`explorer` is what a figure with sliders consists of, and the form of the data that the script gets.
`plane` is a drawing in SVG, `shown` makes HTML of it all.
"""
