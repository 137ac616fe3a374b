"""Points that two heads share, and the heads refined by them (section 2.1, Figure 1).

Found in pixels by Harris corners, correlation and least-squares matching, or measured in the
flight; `refinement` turns the heads until their overlaps agree. Begin with `ties`, then `search`.
"""
