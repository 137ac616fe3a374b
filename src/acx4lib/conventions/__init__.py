"""Every usual reading of a flight's numbers, compared by what it leaves (section 3.2).

Most errors in direct georeferencing are a sign or an axis. `readings` holds the readings of
trajectory, image measurements and control side by side, `mounted` adjusts the mounting of the
cameras of some images on a trajectory that it takes as exact, and what rays still miss is the
misfit of a reading. `search` names the best one, where it is much better than the given one. Begin
with `search`.
"""
