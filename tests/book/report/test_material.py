"""What a report is made of: the run, who made it, and texts in Markdown."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.report import findings, identity, markdown
from acx4book.report.markdown import Document, to_html
from acx4book.report.material import Material, block_of, image_residuals
from acx4files import flight as flights
from acx4files.flight.settings import Certificate, Device, Session
from acx4files.results import folder
from acx4files.results.adjustments import of_transferred
from acx4files.results.provenance import Provenance
from acx4lib.synthetic_image.transferred_points import transfer
from support import figures
from support.flights import in_heads, pictured
from support.run_results import SINGLE, put

# --- material --------------------------------------------------------------------------------
#
# The block that an adjustment of a report has, for a flight that is measured in its heads.


@pytest.fixture(scope="module")
def material(tmp_path_factory):
    flight = flights.read(in_heads.write(tmp_path_factory.mktemp("flight") / "in_heads"))
    results = tmp_path_factory.mktemp("results")
    orientation, camera = pictured.orientation(), flight.synthetic_camera
    transferred = {
        name: transfer(flight.block(name), orientation, camera) for name in flight.transferred
    }
    put(results, "synthetic", [of_transferred(flight, transferred)])
    return Material(
        found=folder.read(results),
        flight=flight,
        provenance=Provenance(files={}, stages={}),
    )


@pytest.mark.parametrize(
    ("adjustment", "block", "cameras"),
    [
        ("heads/bundle/LEFT", "heads", ("LEFT", "RIGHT")),
        ("mounting/rig", "heads", ("LEFT", "RIGHT")),
        ("mounting/rig_calibration", "calibration", ("LEFT", "RIGHT")),
        ("mounting/single_step", "calibration", ("CAM",)),
        ("validation/single_step", "validation", ("CAM",)),
        ("validation/rig", "validation", ("LEFT", "RIGHT")),
    ],
)
def test_every_adjustment_has_the_images_that_it_adjusted(material, adjustment, block, cameras):
    found = block_of(material, adjustment)
    assert found.name == block
    assert tuple(camera.name for camera in found.cameras) == cameras
    assert len(found.image_points) > 40


def test_residuals_stand_where_they_were_measured(run):
    table = image_residuals(run, SINGLE)
    block = run.flight.calibration
    one = table.iloc[7]
    i = block.images.names.index(one["image"])
    k = block.points.index(one["point"])
    seen = block.image_points
    row = np.flatnonzero((seen.image_idx == i) & (seen.point_idx == k))
    assert_allclose(seen.colrow[row[0]], [one["col_px"], one["row_px"]])
    rows = run.residuals[SINGLE]
    own = rows[(rows["image_or_exposure"] == one["image"]) & (rows["point"] == one["point"])]
    assert list(own["v"]) == [one["v_col"], one["v_row"]]


# --- the first page: what is stated, the values with their digits, hostile text --------------


HOSTILE = "<script>alert(1)</script> | $x$ `y` {eq}`1` [a](b)"


@pytest.fixture
def stated(run):
    """The run of a flight with a certificate."""
    said = Certificate(
        number=HOSTILE,
        imu="POS AV 510",
        imu_serial="4711",
        antenna_lever_m=(0.12, -0.03, 1.284),
        valid_until=dt.date(2028, 11, 22),
        cameras={"CAM": Device(maker="Maker", model="M1", serial="08", lens_serial="77")},
    )
    flown = Session(date=dt.date(2026, 11, 20), temperature_c=-3.5)
    return replace(run, flight=replace(run.flight, certificate=said, session=flown))


def test_only_what_is_stated_stands_there(stated):
    page = identity.first_page(stated, []).markdown
    table = figures.table(page, "tab-report-certificate").set_index("Item")["Statement"]
    assert table["Camera CAM"] == "Maker M1 no. 08; lens no. 77"
    assert table["Image format"] == "CAM: 11608 × 8708 pixels of 4.6 µm, 53.40 × 40.06 mm"
    assert table["IMU"] == "POS AV 510 no. 4711"
    assert (
        table["GNSS antenna"] == "+0.120, -0.030, +1.284 m from the IMU, along the body's x, y, z"
    )
    assert table["Flown on"] == "2026-11-20"
    assert table["Temperature"] == "-3.5 °C"
    assert table["Valid until"] == "2028-11-22"
    assert "Flown by" not in table.index
    assert "states no serial numbers" not in page


def test_text_of_strangers_is_shown_and_not_interpreted(stated):
    page = identity.first_page(stated, findings.findings(stated)).markdown
    text = to_html(page, Document())
    assert "<script" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt; | $x$ `y` {eq}`1` [a](b)" in text
    assert "<a " not in text


def test_values_have_the_digits_that_their_sigma_allows(run):
    table = figures.table(identity.first_page(run, []).markdown, "tab-report-values")
    assert "balanced focal length (mm)" in list(table["Parameter"])
    table = table.set_index("Parameter")
    rows = run.found.parameters
    rows = rows[rows["method"] == "single_step"].set_index("parameter")
    f, sigma = table.loc["$f$ (mm)", ["Value", "Standard deviation"]]
    assert float(f) == pytest.approx(rows.loc["f_mm", "value"], abs=6e-5)
    assert float(sigma) == pytest.approx(rows.loc["f_mm", "sigma"], rel=0.05)
    assert len(f.partition(".")[2]) == len(sigma.partition(".")[2])
    k1 = table.loc["$k_1$ (mm⁻²)"]
    assert k1["Value"].endswith("·10⁻⁶")
    assert k1["Standard deviation"].endswith("·10⁻⁸")
    assert len(k1["Value"].partition("·")[0].partition(".")[2]) == 3  # two digits of sigma


# --- Identification of a report: who, with what, from which data


def test_the_identification_names_flight_camera_system_and_software(run):
    page = identity.identity(run).markdown
    said = figures.table(page, "tab-report-identification").set_index("Item")["Statement"]
    assert said["Flight"] == run.flight.name
    assert "pixels of 4.6 µm; declared focal length 50 mm" in said["Camera CAM"]
    assert said["Coordinate system"] == "WGS 84 / UTM zone 33N (EPSG:32633)"
    assert said["Stages computed"] == "mounting and validation"
    assert said["Data, SHA-256"] == f"`{run.provenance.digest}`"
    assert "acx4lib " in said["Software"]


# --- markdown of a report becomes HTML -------------------------------------------------------


def test_markdown_becomes_html_with_numbers_and_without_foreign_markup():
    document = markdown.Document(numbers={"tab-x": "Table 1"})
    text = (
        "See {numref}`tab-x` and {eq}`eq-14`: $x_p$, $\\omega$, $\\chi^2$, "
        "<script>a < b</script>.\n\n"
        "```{table} A *caption*\n:name: tab-x\n\n"
        "| Flight |\n| :--- |\n| ✗ fails |\n| <b>x</b> |\n```"
    )
    html = markdown.to_html(text, document)
    assert "See Table 1 and (14):" in html
    assert "<i>x</i><sub><i>p</i></sub>, <i>ω</i>, <i>χ</i><sup>2</sup>" in html
    assert "<script>" not in html
    assert "&lt;script&gt;a &lt; b&lt;/script&gt;" in html
    assert '<table id="tab-x"><caption><b>Table 1.</b> A <em>caption</em></caption>' in html
    assert "<td>✗ fails</td>" in html or 'align:left">✗ fails</td>' in html  # a name, no answer
    verdict = markdown.to_html(text.replace("tab-x", "tab-report-verdict"), document)
    assert 'class="state fails">✗&nbsp;fails</td>' in verdict
    assert "&lt;b&gt;x" in html
