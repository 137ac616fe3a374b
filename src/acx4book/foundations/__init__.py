"""Part I of the book, foundations: what the chapters of theory need beside the library.

`example` is the flight of four images that goes through all chapters, `shown` sets vectors and
matrices as mathematics. `fitted` is least squares of a small linear system,
`forward_intersection` a point from its rays. `drawings` has a module of figures for each chapter.
"""
