"""Many flights, each run by itself: on processes of this computer, or on a cluster (``acx4 run``).

`jobs` says what is to be done, `runs` does one of them and never fails, `processes` are where, for
images and pairs of pictures, too. `standing` tells whose results need no other run, with a row for
every flight. Begin with `runs`.
"""
