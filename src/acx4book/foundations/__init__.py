"""Part I of the book, foundations: what the chapters of theory need beside the library.

`example` is the flight of four images that goes through all chapters, `shown` sets vectors and
matrices as mathematics, and `drawings` has the figures, a module for every chapter.
"""
