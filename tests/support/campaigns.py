"""Campaigns of simulated flights, and a rig of which one head turned."""

from acx4book.chapters import stability
from acx4book.notebooks.simulated import read
from acx4lib.calibration.mounting import single_step
from acx4lib.calibration.stability import rigidity
from acx4lib.stages import rig
from acx4tools.campaigns import of_mounting


def campaign(flight):
    """Adjust a flight's calibration block in a single step."""
    found = single_step(flight.calibration, free=flight.estimate_mounting)
    return of_mounting(found, name=f"{flight.session.date:%Y-%m}", session=flight.session)


def rigidity_of_a_turned_head(seed):
    """Adjust the heads of a flight together, of which one turned, and test whether they turn."""
    stage = rig.calibrate(read(stability.turning(stability.flown(seed))))
    return rigidity(stage.rig.bundle)
