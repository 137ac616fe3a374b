"""Observations that do not belong: found by data snooping, and taken out of a block."""
