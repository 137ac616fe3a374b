"""What there is to measure is counted as the command counts it."""

from benchmarks.commands import measuring


def test_pairs_and_levels_of_a_block(exact_block):
    n = len(exact_block.images.names)
    small, large = (measuring.counted(exact_block, k) for k in (16, 1))
    assert small["pictures"] == large["pictures"] == n
    assert 0 < small["pairs"] == large["pairs"] <= n * (n - 1) / 2
    assert 0 < small["levels"] < large["levels"]
    assert large["megapixels"] > 200 * small["megapixels"]


def test_the_library_alone_measures_nothing():
    alone = measuring.work(0, 0, 1, 0.0)
    assert not any(alone[name] for name in ("pictures", "pairs", "levels", "megapixels"))
