"""The choices of an adjustment: which parameters it estimates, and how rays run through the air."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from acx4lib import expected
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.collinearity import REFRACTION
from acx4lib.geometry.parameters import AXES, BORESIGHT, LEVER_ARM, TRAJECTORY


@dataclass(frozen=True, kw_only=True)
class Model:
    """What is unknown, and what is held, in every adjustment of a study.

    Attributes
    ----------
    free : sequence of str
        Interior parameters to estimate, names of `camera.INTERIOR`.
    fix : sequence of str
        ``"lever_arm"``, ``"boresight"``: those named keep the values of the cameras.
    refraction : str
        ``"none"``, or ``"standard"`` for rays that the standard atmosphere bends.
    gnss : sequence of str
        Errors of the trajectory to estimate, names of `parameters.TRAJECTORY`: a ``"shift"`` of
        the block, without height where the lever arm's z is estimated; a ``"drift"`` of each strip;
        a ``"delay"`` of the positions; a ``"deviation"`` of the headings.

    Raises
    ------
    ValueError
        For an unknown name.
    """

    free: Sequence[str] = ()
    fix: Sequence[str] = ()
    refraction: str = "none"
    gnss: Sequence[str] = ()

    def __post_init__(self) -> None:
        expected.names_of("free", self.free, INTERIOR)
        expected.names_of("fix", self.fix, ("lever_arm", "boresight"))
        expected.one_of("refraction", self.refraction, REFRACTION)
        expected.names_of("gnss", self.gnss, TRAJECTORY)

    @property
    def mount(self) -> tuple[str, ...]:
        """Parameters of the mounting to estimate, names of `parameters.MOUNT`."""
        lever_arm = () if "lever_arm" in self.fix else LEVER_ARM
        return lever_arm + (() if "boresight" in self.fix else BORESIGHT)

    @property
    def shift(self) -> tuple[str, ...]:
        """Axes of the grid along which a shift of GNSS is estimated.

        A shift in height and a common change of the lever arms' z have the same effect: the height
        of the shift is held where the lever arm is estimated.
        """
        if "shift" not in self.gnss:
            return ()
        return AXES if "lever_arm" in self.fix else AXES[:2]
