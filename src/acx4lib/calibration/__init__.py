"""What a calibration estimates and says (Tables 1 and 3).

Heads by themselves and their relative orientation (sections 2.1 and 4.1), boresight, lever arm and
interior orientation by two steps or a single one (sections 2.2, 4.2, eqs 12-14), all heads as
one rig, a GNSS shift, weights from the residuals, and how well all of it is determined. Begin
with `heads` and `mounting`; `estimates` is what both come to.
"""
