"""The paper held against itself: every finding computed from the printed numbers.

Begin with `audit`.
"""
