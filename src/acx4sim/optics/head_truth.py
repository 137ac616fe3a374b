"""The true parameters of the four heads of the simulated system.

The paper prints results of an adjustment with f held at 74 mm (Table 1), not the true
parameters. The simulator needs the true ones.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from acx4sim.earth import chained_deg
from acx4sim.optics.lens import Camera

_HEAD = Camera(width_px=8984, height_px=6732, pixel_um=6.0, f_mm=74.0)

# With f held at 74 mm, the distance of a head from the ground appears 74/f times as large as it
# is, and a wrong f in an oblique head shifts its x_p and y_p (by up to 0.04 mm here) and turns it
# (by up to 0.03 deg). With these constants an adjustment of exact data of seed 1 gives omega, phi,
# kappa, x_p, y_p, k1, p1, p2 and Zc of Table 1. Zc gives the ratios of the focal lengths. Their
# size follows from Table 3: the calibration block, measured in these heads, carried into the
# synthetic image and adjusted in a single step, gives the f that is printed there.
# tests/support/flights/find_head_truth.py found the constants. The lens centres form a square of
# 16 cm around that of the synthetic camera.
HEADS: Mapping[str, Camera] = MappingProxyType(
    {
        "CAM1": replace(
            _HEAD,
            f_mm=74.43891211,
            xp_mm=-0.08080746287,
            yp_mm=0.02094122703,
            k1=2.291741278e-6,
            p1=2.745151444e-6,
            p2=-7.121418584e-6,
            boresight_deg=(-14.913740208, 12.884544665, 92.998828055),
            lever_m=(0.143, -0.479, -0.201),
        ),
        "CAM2": replace(
            _HEAD,
            f_mm=74.16489615,
            xp_mm=0.02863401576,
            yp_mm=0.0309554604,
            k1=2.068907993e-6,
            p1=-1.100386425e-6,
            p2=-2.797273584e-6,
            boresight_deg=(14.816526265, 12.190429834, -93.415601438),
            lever_m=(0.143, -0.319, -0.201),
        ),
        "CAM3": replace(
            _HEAD,
            f_mm=74.28495397,
            xp_mm=0.1887307131,
            yp_mm=0.006501528272,
            k1=1.951955257e-6,
            p1=-7.39040112e-6,
            p2=4.907780545e-7,
            boresight_deg=(14.747053586, -9.919189293, -87.624864963),
            lever_m=(0.303, -0.319, -0.201),
        ),
        "CAM4": replace(
            _HEAD,
            f_mm=74.3636979,
            xp_mm=-0.2839088059,
            yp_mm=-0.06411115604,
            k1=2.151536399e-6,
            p1=1.214397838e-6,
            p2=2.217764653e-6,
            boresight_deg=(-15.003488816, -9.649322003, 87.420655664),
            lever_m=(0.303, -0.479, -0.201),
        ),
    }
)
"""The heads; their boresight_deg are omega, phi, kappa in the synthetic frame."""


def mounted(name: str, mount_deg: tuple[float, float, float]) -> Camera:
    """Return a head on the IMU.

    Parameters
    ----------
    name : str
        Its name.
    mount_deg : tuple of float
        Omega, phi, kappa of the synthetic frame in the body frame, as flight.toml declares them.
    """
    head = HEADS[name]
    return replace(head, boresight_deg=chained_deg(mount_deg, head.boresight_deg))
