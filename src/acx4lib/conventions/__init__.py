"""Every usual reading of a flight's numbers, compared by what it leaves (section 3.2).

Most errors in direct georeferencing are a sign or an axis. `sightings` takes measurements of some
images, `mounted` adjusts the mounting of their cameras on a trajectory that it takes as exact, and
what rays still miss is the misfit of a reading. `readings` holds the readings of trajectory, image
measurements, control and sigma side by side; `search` names the best one, where it is much better
than the given one. Begin with `search`.
"""
