"""Mutated files: flights, and those of other programs; every outcome must be a sentence."""
