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
# is, and a wrong f in an oblique head shifts its x_p and y_p (by up to 0.13 mm here) and turns it
# (by up to 0.1 deg). With these constants an adjustment of exact data of seed 1 gives omega, phi,
# kappa, x_p, y_p, k1, p1, p2 and Zc of Table 1. Zc gives the ratios of the focal lengths. Their
# size follows from Table 3: the calibration block, measured in these heads, carried into the
# synthetic image and adjusted in a single step, gives the f that is printed there.
# tests/benchmarks/chain/find_head_truth.py found the constants. The lens centres form a square of
# 16 cm, which looks outward, around Table 3's lever arm: that is chosen. What the synthetic camera
# has in k1, k2, k3 comes from it, and so does the lever arm's z that is estimated: the rays of the
# four heads meet above them.
HEADS: Mapping[str, Camera] = MappingProxyType(
    {
        "CAM1": replace(
            _HEAD,
            f_mm=74.4389053,
            xp_mm=-0.08080392474,
            yp_mm=0.02093444368,
            k1=2.291806101e-6,
            p1=2.745062848e-6,
            p2=-7.121845834e-6,
            boresight_deg=(-14.913735852, 12.884539895, 92.998827550),
            lever_m=(0.143, -0.479, -0.201),
        ),
        "CAM2": replace(
            _HEAD,
            f_mm=74.16489102,
            xp_mm=0.0286387633,
            yp_mm=0.03095828064,
            k1=2.068907165e-6,
            p1=-1.100236633e-6,
            p2=-2.797163423e-6,
            boresight_deg=(14.816523601, 12.190427434, -93.415600831),
            lever_m=(0.143, -0.319, -0.201),
        ),
        "CAM3": replace(
            _HEAD,
            f_mm=74.28494785,
            xp_mm=0.1887359703,
            yp_mm=0.006500190715,
            k1=1.951961423e-6,
            p1=-7.390083345e-6,
            p2=4.906455792e-7,
            boresight_deg=(14.747050803, -9.919186678, -87.624866070),
            lever_m=(0.303, -0.319, -0.201),
        ),
        "CAM4": replace(
            _HEAD,
            f_mm=74.36368964,
            xp_mm=-0.2839144687,
            yp_mm=-0.06410368246,
            k1=2.151545704e-6,
            p1=1.214386385e-6,
            p2=2.21805227e-6,
            boresight_deg=(-15.003486335, -9.649317871, 87.420655857),
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
