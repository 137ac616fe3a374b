"""Frames of NOAA's digital sensor system, and OSSIM's ground points: `files`, then `frames`."""
