"""Around a flight: files of other programs, points from pictures, plans, campaigns.

`exchange` reads and writes other programs' files, `measuring` makes image points of pictures,
`planning` says what a flight will determine before it is flown, and `campaigns` compares the
results of two flights of a camera. All stand on `acx4lib`, which needs none of them.
"""
