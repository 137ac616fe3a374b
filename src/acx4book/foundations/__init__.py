"""Part I of the book, foundations: code that the chapters of theory need beside the library.

`example` is the flight of four images that goes through all chapters, `adjusting` has its
adjustments, `drawings` the figures of chapters, `explorers` those that move.
"""
