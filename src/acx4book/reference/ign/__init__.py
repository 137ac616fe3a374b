"""A block of IGN's airborne camera, with surveyed points and the agency's orientation.

`files` converts the agency's conventions, `readings` tries the ways to read its angles, and
`points` are intersected by them.
"""
