"""Pictures and tie points as a stage hands them to its figures."""

import numpy as np

from acx4lib.geometry.camera import inside
from acx4lib.stages.pictures import Exposed, Pictures
from acx4lib.stages.synthetic import Refinement
from acx4lib.synthetic_image.frame import head_from_synthetic
from acx4lib.tie_points.ties import TiePoints
from support.pictures import taken

K = 32
"""Images are reduced by it: 280 x 210 pixels."""

NAMES = ["CAM1", "CAM2", "CAM3", "CAM4"]

PIXEL_MM = 0.0056 * K


def pictured(images, k=K):
    """As the stage hands them to the figures: the exposure in the middle is the second of two."""
    dark = tuple(np.zeros_like(image) for image in images)
    return Pictures(
        exposed=(
            Exposed(exposure="before", exposure_idx=3, images=dark),
            Exposed(exposure="now", exposure_idx=7, images=tuple(images)),
        ),
        reduction=k,
        synthetic=taken.synthetic(k),
        n_complete=2,
    )


def tied(orientation, pair, n, *, shift_mm=(0.0, 0.0), exposure=7, seed=1):
    """Tie points of a pair whose second head is off by a shift in the synthetic image."""
    xy = np.random.default_rng(seed).uniform([-33, -45], [33, 45], (40 * n, 2))
    colrow = [head_from_synthetic(orientation, k, xy) for k in pair]
    both = np.all(
        [inside(orientation.heads[k], c) for k, c in zip(pair, colrow, strict=True)], axis=0
    )
    xy = xy[both][:n]
    a = head_from_synthetic(orientation, pair[0], xy - np.array(shift_mm) / 2)
    b = head_from_synthetic(orientation, pair[1], xy + np.array(shift_mm) / 2)
    ties = TiePoints(
        head_a=np.full(len(xy), pair[0]),
        head_b=np.full(len(xy), pair[1]),
        exposure_idx=np.full(len(xy), exposure),
        point_idx=np.arange(len(xy)),
        colrow_a=a,
        colrow_b=b,
        sigma_px=np.full(len(xy), 1.0),
    )
    return ties, xy


def joined(*parts):
    names = TiePoints.__dataclass_fields__
    return TiePoints(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})


def refined(orientation, ties, **others):
    ways = {"before": orientation} | others
    return Refinement(ties=ties, from_pixels=True, orientations=ways, fits={}, reasons={})
