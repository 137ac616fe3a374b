"""The notebooks of the chapters, run with parameters.

`execute` runs one notebook by papermill and leaves nothing in it that says when and where; `stages`
runs those of a flight, one after the other, into a results folder. Begin with `stages`.
"""
