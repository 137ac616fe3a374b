import numpy as np
import pandas as pd
import pytest

from acx4book.chapters import design
from acx4book.chapters.design import papers
from acx4sim.designs import acx4_ideal_plan
from acx4tools.planning import choosing
from acx4tools.planning.choosing import choose
from acx4tools.planning.design import sigmas
from acx4tools.planning.plan import strip_of


@pytest.fixture(scope="module")
def plan():
    return papers()


@pytest.fixture(scope="module")
def table(plan):
    return pd.DataFrame({n: sigmas(plan.with_control(n, (1300.0, 1000.0))) for n in (2, 5)})


def test_curves_are_the_table_in_readable_units(table):
    fig = design.curves(table, "control points")
    interior, lever, _ = fig.axes
    assert interior.lines[0].get_ydata() == pytest.approx(1000 * table.loc["f_mm"])
    assert lever.lines[0].get_ydata() == pytest.approx(100 * table.loc["lever_z_m"])
    assert all(ax.get_ylim()[1] / ax.get_ylim()[0] > 0.99 * design.LEAST_RANGE for ax in fig.axes)
    both = design.curves(table, "control points", beside=2 * table)
    assert len(both.axes[0].lines) == 6


def test_a_map_shows_strips_where_they_are_flown(plan):
    strips = plan.blocks["calibration"].strips
    flights = {"all": plan, "one": plan.with_strips({"C1": strips["C1"]})}
    fig = design.maps(flights)
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
    chosen = choose(choosing.of(choosing.from_values({"sigma": wanted}, plan)))
    flights = design.flights({"the paper's": plan, "chosen": chosen.plan}, [*wanted])
    written = design.written(flights)
    assert written.iloc[3, 0] == "σ of $f$, mm"
    assert written.iloc[0, 1] == "5"
    assert flights.loc["images", "the paper's"] == 52
    bought = design.bought(chosen)
    assert len(bought) == len(chosen.strips)
    assert bought["minutes"].iloc[-1] == f"{chosen.minutes:.1f}"
    assert bought["σ of f, mm"].iloc[-1] == f"{sigmas(chosen.plan)['f_mm']:.2g}"


@pytest.fixture(scope="module")
def explorer_plan():
    return papers(gnss=("shift",))


@pytest.fixture(scope="module")
def shown(explorer_plan):
    return design.explorer(explorer_plan)


@pytest.mark.parametrize("values", [(1.5, 180.0, 5.0), (1.25, 90.0, 8.0), (1.0, 0.0, 2.0)])
def test_readings_are_those_of_a_plan_of_these_strips(shown, explorer_plan, values):
    ratio, turn, control = values
    camera = explorer_plan.cameras("calibration")[0]
    strips = [
        strip_of(camera, height_m, 28.0 + turned, images=5)
        for height_m in (1000.0, 1000.0 * ratio)
        for turned in (0.0, turn)
    ]
    flown = explorer_plan.with_strips(strips).with_control(int(control), (1300.0, 1000.0))
    expected = sigmas(flown)
    for row, (name, (_, factor)) in zip(shown.readings(values), design.SHOWN.items(), strict=True):
        assert float(row[0]) == pytest.approx(factor * expected[name], rel=0.1, abs=0.006)


def test_control_points_that_are_not_surveyed_are_out_of_the_drawing(shown):
    squares = shown.panels[0].marks[2:]
    for control in design.CONTROL.stops:
        inside = [np.all(np.abs(m.places([1.5, 0.0, control])) < 400) for m in squares]
        assert inside == [k < control for k in range(len(squares))]


def test_the_second_strip_turns_clockwise(shown):
    """Up is the first course, so a quarter turn flies to the right."""
    turned = shown.panels[0].marks[0].places([1.5, 90.0, 5.0])
    start, end = turned[0], turned[1]
    assert end[0] > start[0] + 50
    assert end[1] == pytest.approx(start[1], abs=1e-6)


def test_the_papers_block_is_the_simulators():
    plan = papers(gnss=("shift",))
    block, simulated = plan.blocks["calibration"], acx4_ideal_plan().blocks["calibration"]
    assert [s.n_exposures for s in block.strips.values()] == [s.n for s in simulated.strips]
    heights = [s.flying_height_m for s in block.strips.values()]
    assert heights == [s.height_m for s in simulated.strips]
    assert {*heights} == {1000.0, 1500.0}
    assert plan.setup.gnss == ("shift",)
    assert papers().setup.gnss == ()
