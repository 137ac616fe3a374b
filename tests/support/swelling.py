"""Files that are small, or plain, and want much: time that grows with the square, or memory."""

from __future__ import annotations

import io
import json
import os
import struct
import zipfile
import zlib

from support.fuzz import sources
from support.projects import metashape, opf

CRS = ("--crs", "EPSG:31982")
SIZED = ("--size", "400x300")


# --- texts: `write(folder, n)` returns what is imported, and the options ---------------------


def spaces_in_orientations(folder, n):
    """Write a list in whose heading spaces stand before a quotation mark."""
    return _text(folder, "eo.txt", "image x y z omega phi kappa" + " " * n + '"\n1 2 3 4 5 6 7\n')


def spaces_between_commas(folder, n):
    return _text(folder, "eo.csv", "image,x,y,z" + " " * n + '"\n1,2,3,4\n')


def spaces_in_pospac(folder, n):
    rows = sources.POSPAC.replace("a\t1\t", "a\t1\t" + " " * n + '"')
    return folder_with(folder, {"event.txt": rows}) / "event.txt", CRS


def spaces_in_tracks(folder, n):
    folder_with(folder, {"reconstruction.json": json.dumps([sources.RECONSTRUCTION])})
    tracks = sources.TRACKS.replace("0.jpg\t0", "0.jpg" + " " * n + '"\t0', 1)
    return folder_with(folder, {"tracks.csv": tracks}), ()


def brackets(folder, n):
    """Write JSON whose brackets are strings, one of them without an end."""
    return _text(folder, "reconstruction.json", "[" * 30 + '"\\' * n)


def columns(folder, n):
    names = " ".join(f"c{k}" for k in range(n))
    return _text(folder, "eo.txt", f"image x y z omega phi kappa {names}\n1 2 3\n")


def columns_of_pospac(folder, n):
    heading = "\t".join(["EASTING", "NORTHING", "OMEGA", "PHI", "KAPPA", *["DISTANCE"] * n])
    return folder_with(folder, {"event.txt": f"{heading}\n1\t2\n"}) / "event.txt", CRS


def control(folder, n):
    rows = "".join(f"{669000 + k} 7187900.0 900.0 {k % 90} 20 a.jpg P{k}\n" for k in range(n))
    path = folder_with(folder, {"gcp_list.txt": "WGS84 UTM 22S\n" + rows}) / "gcp_list.txt"
    return path, ()


def surveyed(folder, n):
    """Write MicMac's points, none of which is measured, and measured ones, none surveyed."""
    folder_with(folder, sources.MICMAC)
    one = "<OneAppuisDAF><Pt>669850 7187900 {0}</Pt><NamePt>P{0}</NamePt></OneAppuisDAF>"
    seen = "<OneMesureAF1I><NamePt>T{0}</NamePt><PtIm>500 {0}</PtIm></OneMesureAF1I>"
    for name, put, before in (("points", one, "</Dico"), ("measured", seen, "</MesureAppuiF")):
        text = sources.MICMAC[f"{name}.xml"]
        more = "".join(put.format(k) for k in range(n))
        (folder / f"{name}.xml").write_text(text.replace(before, more + before))
    return folder, CRS


def interiors(folder, n):
    """Write MicMac's orientations, each with an interior orientation of its own."""
    folder_with(folder, sources.MICMAC)
    lens = sources.MICMAC["Ori-A/AutoCal_C.xml"]
    begin, end = lens.index("<KnownConv>"), lens.index("</CalibrationInternConique>")
    one = sources.MICMAC["Ori-A/Orientation-a.JPG.xml"]
    known = "<FileInterne>Ori-A/AutoCal_C.xml</FileInterne>"
    for k in range(n):
        own = lens[begin:end].replace("1000<", f"{1000 + k}<", 1)
        text = one.replace(known, f"<Interne>{own}</Interne>")
        (folder / f"Ori-A/Orientation-{k}.JPG.xml").write_text(text)
    return folder, CRS


def shots(folder, n):
    """Write a reconstruction of many shots, whose orientations are wanted."""
    shot = sources.SHOT | {"gps_position": [1, 2.0, 60.0]}
    many = {f"{k}.jpg": shot | {"translation": [-k, 2.0, 60.0]} for k in range(n)}
    plain = {k: v for k, v in sources.RECONSTRUCTION.items() if not k.startswith("rig")}
    text = json.dumps([plain | {"shots": many, "points": {}}])
    return folder_with(folder, {"reconstruction.json": text}), ("--orientations", "adjusted")


def cameras(folder, n):
    """Write a model of COLMAP with a camera for each image, brought into a flight with remarks."""
    one = " ".join(map(str, (400, 300, 350.0, 350.0, 200.0, 150.0)))
    turn = "1 0 0 0 0 0 0"
    texts = {
        "cameras.txt": "".join(f"{k} PINHOLE {one}\n" for k in range(1, n + 1)),
        "images.txt": "".join(f"{k} {turn} {k} a{k}.jpg\n10 10 1\n" for k in range(1, n + 1)),
        "points3D.txt": f"1 0 0 5 0 0 0 0.5 {' '.join(f'{k} 0' for k in range(1, n + 1))}\n",
    }
    return folder_with(folder, texts), ()


# --- small files that want memory ------------------------------------------------------------


def named_again(folder, n):
    """Write an OPF project that names one JSON file in many ways."""
    opf.write(folder)
    one = folder / "input-control-points.json"
    text = one.read_text().replace('"mtps": []', '"mtps": [' + ",".join(["[]"] * 30_000) + "]")
    one.write_text(text)
    project = json.loads((folder / "project.opf").read_text())
    listed = project["items"][0]["resources"]
    again = next(one for one in listed if "input-control" in one["uri"])
    listed += [again] * (n // 3)
    for k in range(n // 3):
        os.link(one, folder / f"link{k}.json")
        (folder / f"soft{k}.json").symlink_to(one)
        listed += [again | {"uri": f"{name}{k}.json"} for name in ("link", "soft")]
    (folder / "project.opf").write_text(json.dumps(project))
    return folder, ()


def chunks(folder, n):
    """Write a project of Metashape whose chunks are one archive, with much in it."""
    project = metashape.write_project(folder)
    text = metashape.chunk().replace("<sensors>", "<a/>" * 100_000 + "<sensors>")
    pack(folder / "p.files/0/chunk.zip", {"doc.xml": text})
    listed = "".join(f'<chunk id="{k}" path="0/chunk.zip"/>' for k in range(n))
    whole = f'<document><chunks active_id="0">{listed}</chunks></document>'
    pack(folder / "p.files/project.zip", {"doc.xml": whole})
    return project, ()


def meshes(folder, n):
    """Write an OPF project whose tie points are one mesh in many places."""
    opf.write(folder, tracks=True)
    path = folder / "points/sparse.gltf"
    scene = json.loads(path.read_text())
    scene["nodes"] *= n
    path.write_text(json.dumps(scene))
    return folder, ()


def false_header(size):
    """Return a ZIP of `size` bytes of zeros; its header counts what is behind them as packed."""
    packed = zlib.compressobj(9, zlib.DEFLATED, -15)
    part, data = bytes(1_000_000), b""
    for _ in range(size // len(part)):
        data += packed.compress(part)
    data += packed.flush()
    data += os.urandom(size // 150)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("doc.xml", data)
    whole = bytearray(buffer.getvalue())
    at = whole.rindex(b"PK\1\2")
    struct.pack_into("<H", whole, 8, 8)  # deflated
    struct.pack_into("<H", whole, at + 10, 8)
    check = zlib.crc32(bytes(size))
    struct.pack_into("<III", whole, at + 16, check, len(data), size)
    return bytes(whole)


def tags(n, *, count, pages=1):
    """Return a TIFF of one pixel whose `n` tags of a page have the same `count` numbers."""
    begin = 16 + 4 * count
    own = [(256, 4, 1, 1), (257, 4, 1, 1), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1)]
    own += [(270, 2, 4 * count, 16), (273, 4, 1, 8), (279, 4, 1, 1)]
    many = [(40_000 + k % 20_000, 4, count, 16) for k in range(n)]
    directory = b"".join(struct.pack("<HHII", *one) for one in [*own, *many])
    parts = [struct.pack("<2sHI", b"II", 42, begin).ljust(16, b"\0"), bytes(4 * count)]
    for page in range(pages):
        after = begin + (page + 1) * (len(directory) + 6)
        last = page == pages - 1
        parts += [
            struct.pack("<H", len(own) + n),
            directory,
            struct.pack("<I", 0 if last else after),
        ]
    return b"".join(parts)


def exif(n):
    """Return a JPEG whose EXIF has `n` tags with the same 12 kB."""
    count = 3000
    first = struct.pack("<HHHII", 1, 34665, 4, 1, 26 + 4 * count) + bytes(4)
    many = b"".join(struct.pack("<HHII", 1 + k, 4, count, 26) for k in range(n))
    own = struct.pack("<2sHI", b"II", 42, 8) + first + bytes(4 * count)
    own += struct.pack("<H", n) + many + bytes(4)
    part = b"Exif\0\0" + own
    frame = b"\xff\xc0" + struct.pack(">HBHHB", 11, 8, 10, 10, 1) + b"\1\x11\0"
    return b"\xff\xd8\xff\xe1" + struct.pack(">H", len(part) + 2) + part + frame + b"\xff\xd9"


def deflated(width, height):
    """Return a TIFF of zeros, in strips of a hundred rows that all are the same bytes."""
    rows = 100
    n = -(-height // rows)
    strip = zlib.compress(bytes(rows * width), 9)
    begin = 16 + n * len(strip)
    own = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8), (259, 3, 1, 8)]
    own += [(262, 3, 1, 1), (273, 4, n, begin), (277, 3, 1, 1), (278, 3, 1, rows)]
    own += [(279, 4, n, begin + 4 * n)]
    places = struct.pack(f"<{n}I", *(16 + k * len(strip) for k in range(n)))
    sizes = struct.pack(f"<{n}I", *[len(strip)] * n)
    directory = b"".join(struct.pack("<HHII", *one) for one in own)
    head = struct.pack("<2sHI", b"II", 42, begin + 8 * n).ljust(16, b"\0")
    whole = [head, strip * n, places, sizes, struct.pack("<H", len(own)), directory, bytes(4)]
    return b"".join(whole)


# --- what they share -------------------------------------------------------------------------


def folder_with(folder, files):
    """Write files into a folder, and return it."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def pack(path, members):
    """Write a ZIP archive of texts."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in members.items():
            archive.writestr(name, text)


def _text(folder, name, text):
    return folder_with(folder, {name: text}) / name, CRS
