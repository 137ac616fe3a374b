"""Files of other programs, read into plain values.

One module per program. Where its conventions differ from ours (axes, signs, pixel origins,
scales), that module converts them, and nothing else does.
"""
