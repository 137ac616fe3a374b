"""Other people's measurements and results, held against ours (chapters 5 and 11).

One folder for each source, which also converts its conventions. Begin with `comparisons`.
"""
