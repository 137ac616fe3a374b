"""`acx4 import image-points | control-points`, as their user meets them."""


def test_measurements_and_surveyed_points_are_added_to_a_new_flight(acx4, tmp_path):
    (tmp_path / "a.mes").write_text('"P 1" A 10.5 20.5\n"P 1" B 11 21\n')
    (tmp_path / "a.app").write_text('"P 1" 13 676000 7184000 900.5\n')
    flight = tmp_path / "f"
    acx4("new", flight, "--cameras", "CAM", "--crs", "EPSG:31982", "--heights", "ellipsoidal")
    columns = ("--columns", "point image col row", "--first", "0.5", "--camera", "CAM")
    status, said, wrong = acx4(
        "import", "image-points", tmp_path / "a.mes", *columns, "--out", flight
    )
    assert (status, wrong) == (0, "")
    assert "found: 2 measurements of 1 point in 2 images; columns 10.0 to 10.5" in said
    columns = ("--columns", "point skip x y z", "--role", "check")
    status, said, wrong = acx4(
        "import", "control-points", tmp_path / "a.app", *columns, "--out", flight
    )
    assert (status, wrong) == (0, "")
    assert "found: 1 point, 1 of them to check; heights 900.500 to 900.500 m." in said
    rows = (flight / "control_points.csv").read_text().splitlines()
    assert rows == ["point,east_m,north_m,height_m,role", "P 1,676000.0,7184000.0,900.5,check"]


def test_a_heading_that_lacks_a_column_is_one_line(acx4, tmp_path):
    (tmp_path / "a.txt").write_text("DATE : 1/6/2015\nimage point col\nA P 1\n")
    status, _, wrong = acx4("import", "image-points", tmp_path / "a.txt", "--out", tmp_path / "f")
    assert (status, wrong.count("\n")) == (2, 1)
    assert "a.txt:2: columns: have no row; must be point image col row, in any order" in wrong
