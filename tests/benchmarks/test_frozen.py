"""What compares frozen results says where a measure is exceeded, and only there."""

import json

import pytest

from benchmarks import frozen

PARAMETERS = "stage,method,camera,parameter,value,sigma,unit\n"
COVARIANCE = "stage,method,row,column,value\n"
RESIDUALS = "stage,method,kind,image_or_exposure,point,component,v,sigma,redundancy,w\n"
POINTS = "stage,method,point,n_images,d_east_m,sigma_east_m\n"


def faults(tmp_path, before, now, *, exact=False, end="csv"):
    paths = tmp_path / f"before.{end}", tmp_path / f"now.{end}"
    for path, text in zip(paths, (before, now), strict=True):
        path.write_text(text, encoding="utf-8")
    return frozen.KINDS[f".{end}"](*paths, exact=exact)


def parameter(value=74.0, sigma=0.002):
    return f"{PARAMETERS}mounting,single_step,CAM,f_mm,{value!r},{sigma!r},mm\n"


def residual(v=0.3, redundancy=0.9, w=0.6):
    return f"{RESIDUALS}heads,bundle,image_point,A,P,col_px,{v!r},0.5,{redundancy!r},{w!r}\n"


def covariances(off):
    rows = (("x", "x", 4.0), ("x", "y", off), ("y", "y", 1e-6))
    return COVARIANCE + "".join(f"heads,bundle,{a},{b},{c!r}\n" for a, b, c in rows)


def point(n=3, d=0.1, sigma=0.05):
    return f"{POINTS}validation,single_step,N01,{n},{d!r},{sigma!r}\n"


@pytest.mark.parametrize(
    ("before", "within", "beyond"),
    [
        (parameter(), parameter(value=74.0 + 1.9e-9), parameter(value=74.0 + 2.1e-9)),
        (parameter(), parameter(sigma=0.002 * (1 + 9e-8)), parameter(sigma=0.002 * (1 + 1.1e-7))),
        (covariances(1e-4), covariances(1e-4 + 1.9e-9), covariances(1e-4 + 2.1e-9)),
        (residual(), residual(v=0.3 + 4.9e-7), residual(v=0.3 + 5.1e-7)),
        (residual(w=0.6), residual(w=0.6 + 1.0e-6), residual(w=0.6 + 1.1e-6)),
        (residual(), residual(redundancy=0.9 + 9e-6), residual(redundancy=0.9 + 1.1e-5)),
        (point(), point(d=0.1 + 4.9e-8), point(d=0.1 + 5.1e-8)),
        (parameter(sigma=0.0), parameter(74.0 + 7e-11, 0.0), parameter(74.0 + 8e-11, 0.0)),
    ],
)
def test_a_number_may_differ_by_a_fraction_of_its_sigma(tmp_path, before, within, beyond):
    assert faults(tmp_path, before, within) == []
    (fault,) = faults(tmp_path, before, beyond)
    assert "1 cells, the first in row 2" in fault or "the first in row 3" in fault
    assert faults(tmp_path, before, before, exact=True) == []
    assert len(faults(tmp_path, before, within, exact=True)) == 1


@pytest.mark.parametrize(
    "now",
    [
        point(n=4),
        point().replace("N01", "N02"),
        point() + point().splitlines()[1].replace("N01", "N02") + "\n",
        point().replace("n_images", "n_pictures"),
        point().replace("0.05", ""),
    ],
)
def test_keys_counts_rows_columns_and_empty_cells_are_equal(tmp_path, now):
    assert len(faults(tmp_path, point(), now)) == 1


SUMMARY = {
    "heads": {
        "flight": {"sha256": "a"},
        "n_rejected": 2,
        "converged": True,
        "chi_square_p": 0.25,
        "notes": ["sigma 0.412 m of lever z"],
    }
}


@pytest.mark.parametrize(
    ("change", "exact", "differs"),
    [
        ({"flight": {"sha256": "b"}}, True, False),  # of which files it is
        ({"n_rejected": 3}, False, True),
        ({"converged": 1}, False, True),
        ({"chi_square_p": 0.25 + 9e-6}, False, False),
        ({"chi_square_p": 0.25 + 9e-6}, True, True),
        ({"chi_square_p": 0.25 + 1.1e-5}, False, True),
        ({"notes": ["sigma 0.413 m of lever z"]}, False, False),
        ({"notes": ["sigma 0.414 m of lever z"]}, False, True),
        ({"notes": ["sigma 0.412 m of lever y"]}, False, True),
        ({"notes": []}, False, True),
        ({"new": None}, False, True),
    ],
)
def test_a_summary_has_equal_keys_counts_and_words(tmp_path, change, exact, differs):
    now = {"heads": SUMMARY["heads"] | change}
    texts = map(json.dumps, (SUMMARY, now))
    assert bool(faults(tmp_path, *texts, exact=exact, end="json")) == differs


def test_a_thing_that_is_gone_or_new_differs_and_an_origin_is_not_compared(tmp_path):
    before, now = tmp_path / "before", tmp_path / "now"
    for folder, names in ((before, ("a.csv", "b.csv")), (now, ("b.csv", "c.csv"))):
        results = folder / "results" / "one"
        (results / "flight").mkdir(parents=True)
        for name in names:
            (results / name).write_text("x\n1\n")
        for name in ("provenance.json", "flight/flight.toml"):
            (results / name).write_text(str(folder))
    found = dict(frozen.compare(before, now, exact=True))
    assert found == {
        "results/one/a.csv": ["is gone"],
        "results/one/b.csv": [],
        "results/one/c.csv": ["is new"],
    }
