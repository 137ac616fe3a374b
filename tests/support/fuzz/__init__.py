"""Mutated files: flights, results, archives, those of other programs; all end with a sentence."""
