"""Cameras for other programs, and from them.

`opencv` turns the paper's lens, whose distortion is a function of the measured point, into OpenCV's
forward one, and back.
"""
