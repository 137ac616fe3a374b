"""A chunk projected by the formulas of Metashape's manual, written anew here."""

from xml.etree import ElementTree as ET

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4tools.exchange.outward import brown, metashape


def projected(calibration, x_c, *, size=None):
    """The manual's frame camera; u, v from the outer corner, so that half a pixel is taken off."""
    width, height = size or (
        int(calibration.find("resolution").get(k)) for k in ("width", "height")
    )
    values = {one.tag: float(one.text) for one in calibration if one.tag in metashape.PARAMS}
    k1, k2, k3, p1, p2 = (values[k] for k in ("k1", "k2", "k3", "p1", "p2"))
    x, y = (x_c[:, :2] / x_c[:, 2:]).T
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * radial + p1 * (r2 + 2 * x**2) + 2 * p2 * x * y
    yd = y * radial + p2 * (r2 + 2 * y**2) + 2 * p1 * x * y
    u = width * 0.5 + values["cx"] + xd * values["f"] + xd * values.get("b1", 0.0)
    u += yd * values.get("b2", 0.0)
    v = height * 0.5 + values["cy"] + yd * values["f"]
    return np.stack([u, v], axis=1) - 0.5


def matrix(element, shape):
    return np.array(element.text.split(), dtype=float).reshape(shape)


@pytest.fixture(scope="module")
def chunk(shown):
    made = metashape.images(shown.found, shown.oriented)
    return ET.fromstring(made.files["chunk/cameras.xml"]).find("chunk"), made


def test_points_of_the_ground_are_projected_into_every_image(shown, chunk, agrees):
    """Through the ECEF frame: the component's transform, then the camera's."""
    root, made = chunk
    frame = shown.oriented.block.frame
    to_ecef = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        "+step +proj=cart +ellps=GRS80"
    )
    transform = root.find("components/component/transform")
    R, r = (matrix(transform.find(n), s) for n, s in (("rotation", (3, 3)), ("translation", 3)))
    assert transform.find("scale").text == "1.0"
    sensors = {one.get("id"): one for one in root.iter("sensor")}
    cameras = root.findall("cameras/camera")
    assert len(cameras) == 12
    for camera in cameras:
        sensor, name = sensors[camera.get("sensor_id")], camera.get("label")
        x_e = np.stack(to_ecef.transform(*frame.to_geographic(shown.x_m[name]).T), axis=1)
        T = matrix(camera.find("transform"), (4, 4))
        x_c = ((x_e - r) @ R - T[:3, 3]) @ T[:3, :3]
        adjusted = sensor.find("calibration[@class='adjusted']")
        agrees(projected(adjusted, x_c), shown.colrow[name], made.lenses[sensor.get("label")])


def test_the_rotation_of_a_slave_takes_its_axes_to_the_masters(shown):
    """Of rays: positions of heads have no place in a sensor."""
    text = metashape.cameras(shown.found).files["chunk/cameras.xml"]
    master, slave = ET.fromstring(text).iter("sensor")
    assert (master.get("master_id"), slave.get("master_id")) == (None, "0")
    R = matrix(slave.find("rotation"), (3, 3))
    first, second = shown.found.cameras
    assert_allclose(
        R,
        np.diag([1, -1, -1]) @ first.T_b_c.R.T @ second.T_b_c.R @ np.diag([1, -1, -1]),
        atol=1e-12,
    )


def test_a_calibration_that_metashape_loads_says_the_same_as_the_sensor(shown, chunk, agrees):
    for camera in shown.found.cameras:
        text = metashape.cameras(shown.found).files[f"{camera.name}.xml"]
        alone = ET.fromstring(text)
        size = tuple(int(alone.find(key).text) for key in ("width", "height"))
        x_c = shown.x_m[shown.first_images()[camera.name]]
        x_c = ahead_of(shown, camera.name, x_c)
        seen = projected(alone, x_c, size=size)
        wanted = shown.colrow[shown.first_images()[camera.name]]
        agrees(seen, wanted, chunk[1].lenses[camera.name])
        assert alone.find("projection").text == "frame"


def ahead_of(shown, head, x_m):
    i = shown.oriented.names.index(shown.first_images()[head])
    T = shown.oriented.T_m_c[i]
    return (x_m - T.r) @ T.R * [1, -1, -1]


def test_the_covariance_is_that_of_refitted_lenses(shown, chunk, rng):
    """Of many interior orientations drawn with the calibration's covariance."""
    sensor = next(chunk[0].iter("sensor"))
    names = sensor.find("covariance/params").text.split()
    cov = matrix(sensor.find("covariance/coeffs"), (len(names), len(names)))
    calibration, camera = shown.found.calibration, shown.found.cameras[0]
    own = calibration.layout.interior[0]
    drawn = rng.multivariate_normal(
        camera.interior.to_array(), calibration.cov[np.ix_(own, own)], size=400
    )
    fits = [brown.brown(camera.with_interior(type(camera.interior).from_array(d))) for d in drawn]
    values = {
        "f": [one.hole.fy for one in fits],
        "cx": [one.hole.cx for one in fits],
        "b1": [one.hole.fx - one.hole.fy for one in fits],
        "b2": [one.hole.skew for one in fits],
        "k1": [one.k1 for one in fits],
        "p1": [one.p2 for one in fits],
    }
    for name, scatter in values.items():
        k = names.index(name)
        assert np.std(scatter) == pytest.approx(np.sqrt(cov[k, k]), rel=0.15)  # 4 sigma
