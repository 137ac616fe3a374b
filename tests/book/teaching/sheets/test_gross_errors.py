from acx4book.teaching.sheets import gross_errors
from acx4lib.stages.mounting import calibrate


def strongest(bundle, kind):
    return max((r for r in bundle.rejected if r.kind == kind), key=lambda r: r.statistic).row


def test_what_was_planted_is_what_the_library_finds(solved):
    """The sheet can be solved: for every student the three large errors are rejected."""
    for k in range(12):
        case, right = solved("lab-5", f"Student {k}")
        block = case.block
        bundle = calibrate(case.flight).mountings["single_step"].bundle
        point = block.points[block.control.point_idx[strongest(bundle, "control_point")]]
        assert gross_errors.number(point) == right["control_point"].truth
        for kind, question in (("gnss", "gnss_exposure"), ("attitude", "attitude_exposure")):
            name = block.trajectory.exposures[strongest(bundle, kind)]
            assert gross_errors.number(name) == right[question].truth
        found = sum(rejection.kind == "image_point" for rejection in bundle.rejected)
        assert abs(found - right["rejected_points"].truth) <= 2
