"""Standard deviations over the format are drawn where they are, in centimetres."""

import numpy as np

from acx4book.typesetting.field import sigma_figure
from acx4lib.georeferencing.budget import SOURCES, Budget
from acx4lib.georeferencing.mapping_flight import Format
from support.figures import drawn, panels


def test_panels_have_plan_height_and_the_calibrations_part():
    """Variances of 1, 4 and 9 cm^2 of image points, and 16 cm^2 of the interior in height."""
    variance = np.zeros((4, 3, len(SOURCES)))
    variance[:, :, SOURCES.index("image points")] = np.array([1.0, 4.0, 9.0]) * 1e-4
    variance[:, 2, SOURCES.index("interior orientation")] = 16e-4
    variance[3] = np.nan
    col, row = np.meshgrid([0.0, 99.0], [0.0, 199.0])
    shown = Format(colrow=np.stack([col, row], axis=-1), budget=Budget(variance=variance))
    axes = panels(drawn(sigma_figure(shown)))[:3]
    for ax, cm in zip(axes, (np.sqrt(5.0), 5.0, 4.0), strict=True):
        image = np.ma.filled(ax.images[0].get_array(), np.nan)
        np.testing.assert_allclose(image.ravel(), [cm, cm, cm, np.nan])
        assert ax.get_ylim() == (199.0, 0.0)
    assert [ax.get_title(loc="left") for ax in axes] == ["plan", "height", "height, calibration"]
