"""Direct georeferencing, tested (sections 2.3 and 4.3, Table 4).

`direct` applies eq. (14) to observed positions and attitudes and intersects rays; `validation`
holds the points against surveyed ones; `accuracy` and `standards` say what the differences mean.
"""
