"""What imports said is shown with its command, long lines broken."""

from acx4book.pages.benchmarks import speed
from acx4book.pages.build import BENCHMARKS
from support.helpers import ROOT


def test_every_kind_has_its_text():
    texts = dict(speed.of_imports(ROOT / BENCHMARKS))
    assert texts["imports-sbet.txt"].startswith("$ acx4 import sbet applanix_pdal/2-points.sbet")
    for text in texts.values():
        assert max(map(len, text.splitlines())) <= speed.WIDTH
        assert "  found: " in text
