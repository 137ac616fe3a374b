"""The teaching kit in the book: questions, solutions and mistakes of every sheet as tables.

`tables` computes them from a demonstration flight when the book is made; `slides` is one lecture
as a page of its own, and `figure_pack` the figures of the book in one archive.
"""
