"""RigRelatives read as real pictures of the vendor have them: M^T takes rays into the head."""

import csv
from pathlib import Path

import numpy as np
import pytest

from acx4lib.geometry.camera import correct, xy_from_colrow
from acx4tools.exchange.outward import micasense
from acx4tools.exchange.pictures.lens import lens_of
from acx4tools.exchange.pictures.tags import Tags


def tags_of(text):
    found, own = {}, {}
    for line in text.splitlines():
        if line.startswith("["):
            own = found[line.strip("[]")] = {}
        elif line:
            key, _, value = line.partition(" = ")
            own[key.removeprefix("Camera:")] = value
    return found


def numbers(text):
    return np.array(text.split(","), dtype=float)


def turn(axis, degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[j, j], R[k, k], R[k, j], R[j, k] = c, c, s, -s
    return R


@pytest.fixture(scope="module")
def made(shown):
    return micasense.cameras(shown.found)


def test_rays_of_the_reference_go_into_every_head_by_the_transpose(shown, made, agrees):
    """To where the head sees them, by its own focal length, principal point and distortion."""
    pixel_mm = shown.found.cameras[0].pixel_mm
    for head, own in tags_of(made.files["xmp_tags.txt"]).items():
        a, b, c = numbers(own["RigRelatives"])
        M = turn(0, a) @ turn(1, b) @ turn(2, c)
        x = (shown.x_r[head] - base(shown, head)) * [1, -1, -1] @ M
        x, y = (x[:, :2] / x[:, 2:]).T
        k1, k2, k3, p1, p2 = numbers(own["PerspectiveDistortion"])
        r2 = x**2 + y**2
        d = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        xd = x * d + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
        yd = y * d + 2 * p2 * x * y + p1 * (r2 + 2 * y**2)
        f, at = numbers(own["PerspectiveFocalLength"])[0], numbers(own["PrincipalPoint"])
        seen = (np.stack([xd, yd], axis=1) * f + at) / pixel_mm
        agrees(seen, shown.colrow[shown.first_images()[head]], made.lenses[head])


def base(shown, head):
    """Where the head is in the axes of the reference: rays know nothing of it."""
    first = shown.found.cameras[0].T_b_c
    other = next(c for c in shown.found.cameras if c.name == head).T_b_c
    return first.R.T @ (other.r - first.r)


def test_the_table_has_sigma_of_all_heads(made):
    reference, other = csv.DictReader(made.files["rig_relatives.csv"].splitlines())
    assert (reference["camera"], reference["rig_camera_index"]) == ("LEFT", "0")
    assert [float(reference[f"{k}_deg"]) for k in ("a", "b", "c", "sigma_a", "sigma_b")] == [
        0.0
    ] * 5
    assert all(1e-4 < float(other[f"sigma_{k}_deg"]) < 0.1 for k in "abc")
    said = numbers(tags_of(made.files["xmp_tags.txt"])["RIGHT"]["RigRelatives"])
    assert [float(other[f"{k}_deg"]) for k in "abc"] == pytest.approx(said.tolist(), abs=1e-6)


def test_the_reader_of_pictures_makes_the_cameras_of_the_tags(shown, made):
    """To twice what the refit loses: rays of points all over the image."""
    for camera in shown.found.cameras:
        own = tags_of(made.files["xmp_tags.txt"])[camera.name]
        picture = Tags(
            path=Path("a.tif"),
            width_px=camera.width_px,
            height_px=camera.height_px,
            samples=1,
            bits=16,
            exif={"FocalPlaneXResolution": 1 / camera.pixel_mm, "FocalPlaneResolutionUnit": 4},
            xmp={f"Camera:{key}": (value,) for key, value in own.items()},
            sha256="",
        )
        back = lens_of(picture, camera.name).camera
        colrow = shown.colrow[shown.first_images()[camera.name]]
        rays = [
            correct(c.interior, xy_from_colrow(c, colrow)) / c.interior.f for c in (camera, back)
        ]
        apart = np.linalg.norm(rays[0] - rays[1], axis=1).max() * camera.interior.f
        assert apart / camera.pixel_mm <= 2.1 * made.lenses[camera.name].largest_px + 1e-3
