from acx4book.chapters.beyond.design.plans import papers
from acx4sim.designs import acx4_ideal_plan


def test_the_papers_block_is_the_simulators():
    plan = papers(gnss=("shift",))
    block, simulated = plan.blocks["calibration"], acx4_ideal_plan().blocks["calibration"]
    assert [s.n_exposures for s in block.strips.values()] == [s.n for s in simulated.strips]
    heights = [s.flying_height_m for s in block.strips.values()]
    assert heights == [s.height_m for s in simulated.strips]
    assert {*heights} == {1000.0, 1500.0}
    assert plan.setup.gnss == ("shift",)
    assert papers().setup.gnss == ()
