"""What is stored of the measurements of others is what they give again."""

import pandas as pd
import pytest

from acx4book.chapters.beyond.distortion_models.families import MODELS
from benchmarks.chain import distortion_models
from support.reference_files import needs

pytestmark = [pytest.mark.slow, needs("dbat-camcal")]


@pytest.mark.parametrize("model", [MODELS[0], MODELS[-2]], ids=lambda model: model.name)
def test_the_real_camera_computed_again_gives_the_stored_numbers(model):
    stored = pd.read_csv(distortion_models.OUT / "distortion_models.csv")
    kept = stored[(stored["case"] == "camcal") & (stored["model"] == model.name)].iloc[0]
    found = distortion_models.of_real(model)
    for name in ("cost", "observations", "redundancy", "joint", "correlation", "strip_px"):
        assert found[name] == pytest.approx(kept[name], rel=1e-4), name  # stored to seven digits
