"""`acx4 new` as its user meets it."""

import io


def test_options_answer_all_questions(acx4, tmp_path):
    options = ("--cameras", "RGB", "--crs", "EPSG:31982", "--heights", "-25.5")
    status, said, wrong = acx4("new", tmp_path / "f", *options)
    assert (status, wrong) == (0, "")
    assert "still to do: " in said
    assert "cameras.RGB.width_px: missing; required" in said
    assert "heights = -25.5" in (tmp_path / "f" / "flight.toml").read_text()
    status, _, wrong = acx4("new", tmp_path / "f", *options)
    assert status == 2
    assert wrong.endswith("an import began this flight already; choose another folder\n")


def test_what_is_not_answered_is_asked_on_a_terminal_only(acx4, tmp_path, monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    status, _, wrong = acx4("new", tmp_path / "f", "--crs", "EPSG:31982")
    assert status == 2
    assert wrong == "--cameras, --heights: missing; on a terminal the command asks for them\n"
    monkeypatch.setattr("sys.stdin", Terminal("A, B\n\n"))
    status, _, wrong = acx4("new", tmp_path / "f", "--crs", "EPSG:31982")
    assert status == 0
    assert "Names of the cameras" in wrong
    assert 'heads = ["A", "B"]' in (tmp_path / "f" / "flight.toml").read_text()


def test_names_and_numbers_that_no_flight_has_are_refused(acx4, tmp_path):
    for cameras, heights, says in (
        ("=A", "ellipsoidal", "would be computed as a formula"),
        ("A,A", "ellipsoidal", "must be names that are all different"),
        ("A", "5773", "--heights: 5773: must be at most 200 m either way"),
    ):
        options = ("--cameras", cameras, "--crs", "EPSG:31982", "--heights", heights)
        status, _, wrong = acx4("new", tmp_path / "f", *options)
        assert (status, says in wrong, wrong.count("\n")) == (2, True, 1)
    assert not (tmp_path / "f").exists()


def test_a_crs_that_the_check_refuses_is_refused_at_once(acx4, tmp_path):
    options = ("--cameras", "A", "--heights", "ellipsoidal")
    for crs, says in (
        ("EPSG:4326", "'EPSG:4326' (WGS 84) is not a projected CRS; must be a projected CRS"),
        ("EPSG:2225", "in US survey foot, not in metres"),
        ("my own", "is neither an authority code, nor WKT"),
    ):
        status, _, wrong = acx4("new", tmp_path / "f", "--crs", crs, *options)
        assert (status, says in wrong, wrong.count("\n")) == (2, True, 1)
    assert not (tmp_path / "f").exists()
    # metres east and north, though its latitudes are grads: the check has no word on it
    status, said, _ = acx4("new", tmp_path / "f", "--crs", "EPSG:27561", *options)
    assert status == 0
    assert "PROJ" not in said
    assert "metres" not in said


def test_a_geoid_grid_is_brought_into_the_flight(acx4, tmp_path):
    (tmp_path / "geoid.gtx").write_bytes(b"grid")
    options = ("--cameras", "A", "--crs", "EPSG:31982", "--heights", tmp_path / "geoid.gtx")
    status, said, _ = acx4("new", tmp_path / "f", *options)
    assert status == 0
    assert 'heights = "geoid.gtx"' in (tmp_path / "f" / "flight.toml").read_text()
    assert (tmp_path / "f" / "geoid.gtx").read_bytes() == b"grid"
    assert "PROJ cannot read it as a geoid grid" in said
