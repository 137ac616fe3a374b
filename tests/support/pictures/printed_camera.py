"""The four heads of Table 1 and the synthetic camera of Table 2, as printed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4book.paper import printed
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Camera, Interior


def heads(names: Sequence[str] = printed.HEADS) -> RelativeOrientation:
    """Return heads of Table 1 as an orientation without errors."""
    width, height = (int(printed.statement(f"head_{side}_px")) for side in ("width", "height"))
    return RelativeOrientation(
        heads=tuple(
            Camera(
                name=name,
                width_px=width,
                height_px=height,
                pixel_mm=printed.pixel_mm(name),
                interior=printed.interior(1, name),
            )
            for name in names
        ),
        xyz_mm=np.stack([printed.centre_mm(name) for name in names]),
        opk=np.stack([printed.opk(name) for name in names]),
        cov_joint=np.zeros((16 * len(names), 16 * len(names))),
        n_exposures=1,
    )


def synthetic() -> Camera:
    """Return the synthetic camera of Table 2, with the focal length of its heads."""
    return Camera(
        name="SYN",
        width_px=int(printed.value(2, "width_px", "SYN")),
        height_px=int(printed.value(2, "height_px", "SYN")),
        pixel_mm=printed.pixel_mm("SYN"),
        interior=Interior(f=printed.statement("head_f_fixed_mm")),
    )
