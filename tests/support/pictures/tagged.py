"""Pictures with the metadata of drone cameras, written by Pillow, over a ground known exactly."""

import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import IFDRational, ImageFileDirectory_v2
from scipy.spatial.transform import Rotation

EXIF, GPS = 0x8769, 0x8825
F_PX, PIXEL_MM, SIZE = 364.0, 0.015, (320, 240)

HEAD = """<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
"""
TAIL = "</rdf:RDF></x:xmpmeta>\n   <?xpacket end='w'?>"
SPACES = {
    "Camera": "http://pix4d.com/camera/1.0",
    "MicaSense": "http://micasense.com/MicaSense/1.0/",
    "DLS": "http://micasense.com/DLS/1.0/",
    "drone-dji": "http://www.dji.com/drone-dji/1.0/",
}


def packet(properties, *, attributes=False):
    """Return an XMP packet; lists become sequences, and text elements or attributes."""
    parts = []
    for prefix, space in SPACES.items():
        own = {k: v for k, v in properties.items() if k.startswith(f"{prefix}:")}
        inside = "".join(f"<{k}>{_value(v)}</{k}>" for k, v in own.items() if not attributes)
        beside = " ".join(f'{k}="{v}"' for k, v in own.items() if attributes)
        if own:
            parts.append(
                f'<rdf:Description rdf:about="" xmlns:{prefix}="{space}" {beside}>{inside}'
                "</rdf:Description>"
            )
    return (HEAD + "\n".join(parts) + TAIL).encode()


def _value(value):
    if isinstance(value, list):
        return f"<rdf:Seq>{''.join(f'<rdf:li>{one}</rdf:li>' for one in value)}</rdf:Seq>"
    return str(value)


def metadata(*, lat=47.5, lon=-3.2, height=55.0, pixel_mm=PIXEL_MM, time="2024:05:01 10:20:30"):
    """Return EXIF with position, time and pixel size; what is None is left out."""
    exif = Image.Exif()
    exif[271], exif[272] = "MicaSense", "RedEdge-T"
    own, gps = exif.get_ifd(EXIF), exif.get_ifd(GPS)
    own[36867], own[37521] = time, "25"
    if pixel_mm is not None:
        own[41486], own[41488] = IFDRational(round(1e6 / pixel_mm), 10**6), 4
    if lat is not None:
        gps[1], gps[2] = "S" if lat < 0 else "N", _degrees(lat)
        gps[3], gps[4] = "W" if lon < 0 else "E", _degrees(lon)
        gps[5], gps[6] = (
            b"\x01" if height < 0 else b"\x00",
            IFDRational(round(1000 * abs(height)), 1000),
        )
    return exif


def _degrees(angle):
    whole, rest = divmod(abs(angle), 1)
    minutes, rest = divmod(60 * rest, 1)
    return (
        IFDRational(int(whole)),
        IFDRational(int(minutes)),
        IFDRational(round(6e8 * rest), 10**7),
    )


def write(path, properties, *, exif=None, pixels=None, attributes=False):
    """Write a TIFF of 16 bit, or a JPEG of 8, with EXIF and XMP."""
    path.parent.mkdir(parents=True, exist_ok=True)
    exif = metadata() if exif is None else exif
    words = packet(properties, attributes=attributes) if properties is not None else b""
    if path.suffix.lower() in {".tif", ".tiff"}:
        grey = np.full(SIZE[::-1], 20000, np.uint16) if pixels is None else pixels
        info = ImageFileDirectory_v2()
        for tag in (271, 272, 700):
            info[tag] = words if tag == 700 else exif[tag]
        for tag in (EXIF, GPS):
            info[tag] = dict(exif.get_ifd(tag))
        Image.fromarray(grey).save(path, tiffinfo=info)
    else:
        Image.fromarray(np.full((*SIZE[::-1], 3), 99, np.uint8)).save(path, exif=exif, xmp=words)
    return path


def micasense(index, *, relatives=None, reference=0, focal=None, band=None, **others):
    """Return the properties of a head, as MicaSense writes them."""
    width, height = SIZE
    found = {
        "MicaSense:CaptureId": "capture-1",
        "Camera:BandName": band or f"Band{index}",
        "Camera:RigCameraIndex": index,
        "Camera:ModelType": "perspective",
        "Camera:PrincipalPoint": f"{PIXEL_MM * (width - 1) / 2},{PIXEL_MM * (height - 1) / 2}",
        "Camera:PerspectiveFocalLength": F_PX * PIXEL_MM if focal is None else focal,
        "Camera:PerspectiveDistortion": [0, 0, 0, 0, 0],
    }
    if relatives is not None:
        found["Camera:RigRelatives"] = ", ".join(map(str, relatives))
        found["Camera:RigRelativesReferenceRigCameraIndex"] = reference
    return found | others


def pictures_of(rotations, bands):
    """Return 16-bit pictures of heads over one plane, which are sums of waves, exactly sampled.

    Parameters
    ----------
    rotations : sequence of tuple
        a, b, c of Rx Ry Rz, degrees, from the head to the first; y down, z ahead.
    bands : sequence of tuple
        Shares of two landscapes that have nothing to do with each other.
    """
    rng = np.random.default_rng(1)
    waves = [_waves(rng) for _ in range(2)]
    col, row = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    ray = np.stack([col - (SIZE[0] - 1) / 2, row - (SIZE[1] - 1) / 2, np.full(col.shape, F_PX)], -1)
    out = []
    for angles, shares in zip(rotations, bands, strict=True):
        turned = ray @ Rotation.from_euler("XYZ", angles, degrees=True).as_matrix().T
        at = F_PX * turned[..., :2] / turned[..., 2:]
        grey = sum(share * _grey(at, wave) for share, wave in zip(shares, waves, strict=True))
        noise = rng.normal(0, 60, grey.shape)
        out.append(np.clip(30000 + 6000 * grey + noise, 0, 65535).astype(np.uint16))
    return out


def _waves(rng):
    n = 50
    lengths, directions = rng.uniform(5, 60, n), rng.uniform(0, 2 * np.pi, n)
    k = 2 * np.pi / lengths * np.array([np.cos(directions), np.sin(directions)])
    return k, rng.uniform(0, 2 * np.pi, n), np.sqrt(2 / n)


def _grey(at, wave):
    k, phase, size = wave
    return size * np.cos(at @ k + phase).sum(axis=-1)
