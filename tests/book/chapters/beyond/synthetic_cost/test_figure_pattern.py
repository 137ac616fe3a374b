"""The residual pattern of the synthetic image, drawn."""

from matplotlib.quiver import Quiver

from acx4book.chapters.beyond.synthetic_cost import figure_pattern, study


def test_every_height_has_its_field_and_its_seams():
    fig = figure_pattern.pattern(study.read())
    titles = [ax.get_title(loc="left") for ax in fig.axes]
    assert titles == ["From 1000 m", "From 1500 m"]
    for ax in fig.axes:
        (field,) = (c for c in ax.collections if isinstance(c, Quiver))
        assert 200 < field.N < 400
        assert ax.get_ylim() == (16200, 0)
