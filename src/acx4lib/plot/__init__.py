"""Figures of the book: every function takes results and returns a figure, and changes nothing."""
