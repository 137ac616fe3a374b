"""Figures of the synthetic image: its frame, the pictures, overlaps, responses and seams."""
