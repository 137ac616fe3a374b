"""Chapter 13, beyond the paper: adjustments that start far from the truth.

`trials` adjusts a simulated flight from many bad starts, `figures` draws what becomes of them.
"""
