"""Mutated flights; all end with a sentence."""
