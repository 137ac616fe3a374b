"""Imports of other adjustments as their users meet them: files, lines and statuses."""

import json

import pytest

LIST = "P1 C\n1006 -1.5 1.5\n1020 3.0 -0.75\n-99\n"
CONTROL = "WGS84 UTM 22S\n669850.0 7187900.0 900.0 10 20 a.jpg\n"
MODEL = {"projection_type": "perspective", "width": 400, "height": 300, "focal": 0.9}
MICMAC = """<SetOfMesureAppuisFlottants><MesureAppuiFlottant1Im><NameIm>a.JPG</NameIm>
<OneMesureAF1I><NamePt>P</NamePt><PtIm>1 2</PtIm></OneMesureAF1I>
</MesureAppuiFlottant1Im></SetOfMesureAppuisFlottants>"""
BUNDLE = """# Bundle file v0.3
1 1
700 0 0
1 0 0
0 1 0
0 0 1
0 0 0
0 0 -10
1 2 3
1 0 0 5 6
"""
SIZED = ("--size", "400x300")
KINDS = {
    "opensfm": (json.dumps({"m": MODEL}), ()),
    "micmac": (MICMAC, ()),
    "bundler": (BUNDLE, SIZED),
    "bingo": (LIST, (*SIZED, "--pixel-um", 20)),
    "patb": (LIST, (*SIZED, "--pixel-um", 20, "--unit", "mm")),
    "odm-control": (CONTROL, ("--camera", "C")),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_flight_is_begun_and_what_it_lacks_is_named(acx4, tmp_path, kind):
    content, options = KINDS[kind]
    source = tmp_path / "source"
    source.write_text(content)
    status, said, wrong = acx4("import", kind, source, "--out", tmp_path / "f", *options)
    assert (status, wrong) == (0, "")
    assert "  assumed: " in said
    assert "  found: " in said
    assert "  still to do: " in said
    assert 'name = "f"' in (tmp_path / "f" / "flight.toml").read_text() or kind == "micmac"
    assert "SHA-256" in (tmp_path / "f" / "import.md").read_text()


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_of_something_else_is_one_line(acx4, tmp_path, kind):
    source = tmp_path / "source"
    source.write_bytes(b"\x89PNG\r\n\x1a\n\0\0")
    _, options = KINDS[kind]
    status, said, wrong = acx4("import", kind, source, "--out", tmp_path / "f", *options)
    assert (status, said) == (2, "")
    assert len(wrong.splitlines()) == 1
    assert wrong.startswith(f"{source}:")
    assert not (tmp_path / "f").exists()


@pytest.mark.parametrize("size", ["400", "400x0", "x", "4000000000x1", "-4x3"])
def test_a_size_is_width_and_height(acx4, tmp_path, size):
    (tmp_path / "a").write_text(BUNDLE)
    status, _, wrong = acx4(
        "import", "bundler", tmp_path / "a", "--out", tmp_path / "f", "--size", size
    )
    assert status == 2
    assert "must be width x height in pixels, such as 4000x3000" in wrong
