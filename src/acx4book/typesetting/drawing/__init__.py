"""Figures as vector drawings for pages.

Begin with `svg`, which makes a drawing of a figure; `compact` writes the same drawing shorter, and
`inline` makes it a part of a page.
"""
