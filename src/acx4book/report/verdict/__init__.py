"""The statement at the top of a report: `verdict` asks, the other modules answer.

`adjusted` judges the adjustments by themselves, `compared` what they are held against: declared
mountings, heights, check points. An answer is a `finding`.
"""
