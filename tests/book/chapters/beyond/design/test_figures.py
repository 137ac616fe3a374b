import numpy as np
import pandas as pd
import pytest

from acx4book.chapters.beyond.design import figures, tables
from acx4book.chapters.beyond.design.plans import papers
from acx4lib.planning.choosing import candidates, target
from acx4lib.planning.choosing.chosen import choose
from acx4lib.planning.design import sigmas


@pytest.fixture(scope="module")
def plan():
    return papers()


@pytest.fixture(scope="module")
def table(plan):
    return pd.DataFrame({n: sigmas(plan.with_control(n, (1300.0, 1000.0))) for n in (2, 5)})


def test_curves_are_the_table_in_readable_units(table):
    fig = figures.curves(table, "control points")
    interior, lever, _ = fig.axes
    assert interior.lines[0].get_ydata() == pytest.approx(1000 * table.loc["f_mm"])
    assert lever.lines[0].get_ydata() == pytest.approx(100 * table.loc["lever_z_m"])
    assert all(ax.get_ylim()[1] / ax.get_ylim()[0] > 0.99 * figures.LEAST_RANGE for ax in fig.axes)
    both = figures.curves(table, "control points", beside=2 * table)
    assert len(both.axes[0].lines) == 6


def test_a_map_shows_strips_where_they_are_flown(plan):
    strips = plan.blocks["calibration"].strips
    flights = {"all": plan, "one": plan.with_strips({"C1": strips["C1"]})}
    fig = figures.maps(flights)
    first = fig.axes[0]
    assert [ax.get_title() or ax.get_title(loc="left") for ax in fig.axes] == [*flights]
    arrows = [text for text in first.texts if getattr(text, "arrow_patch", None) is not None]
    assert len(arrows) == 5
    strip = strips["C2"]
    start, end = np.array(arrows[1].xyann), np.array(arrows[1].xy)
    length = 0.001 * strip.base_m * (strip.n_exposures - 1)
    assert np.hypot(*(end - start)) == pytest.approx(length)
    course = np.degrees(np.arctan2(*(end - start))) % 360
    assert course == pytest.approx(strip.course_deg % 360, abs=0.1)


def test_the_tables_have_names_and_units(plan):
    wanted = {"f_mm": 0.002, "lever_z_m": 0.04, "lever_x_m": 0.1, "boresight_kappa_deg": 0.004}
    chosen = choose(candidates.of(target.from_values({"sigma": wanted}, plan)))
    flights = tables.flights({"the paper's": plan, "chosen": chosen.plan}, [*wanted])
    written = tables.written(flights)
    assert written.iloc[3, 0] == "σ of $f$, mm"
    assert written.iloc[0, 1] == "5"
    assert flights.loc["images", "the paper's"] == 52
    bought = tables.bought(chosen)
    assert len(bought) == len(chosen.strips)
    assert bought["minutes"].iloc[-1] == f"{chosen.minutes:.1f}"
    assert bought["σ of f, mm"].iloc[-1] == f"{sigmas(chosen.plan)['f_mm']:.2g}"
