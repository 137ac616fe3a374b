"""Pixels sampled and blended, compiled: what `rendering` asks for."""
