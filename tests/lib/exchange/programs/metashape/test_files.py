"""Projects of Metashape in their archives."""

import pytest

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.metashape import files, reading
from support.projects import metashape


def test_a_project_in_archives_is_the_exported_file(tmp_path):
    exported = reading.read(metashape.write(tmp_path / "c.xml"))
    packed = reading.read(metashape.write_project(tmp_path))
    assert packed.tables == exported.tables
    assert packed.settings == exported.settings
    assert next(iter(packed.sha256)) == "p.psx"


def test_a_chunk_s_archive_alone_will_do(tmp_path):
    metashape.write_project(tmp_path)
    found = files.chunk(tmp_path / "p.files" / "0" / "chunk.zip")
    assert found.root.attributes["label"] == "Chunk 1"
    assert found.frame is not None


def test_a_chunk_is_chosen_by_its_label(tmp_path):
    metashape.write_project(tmp_path)
    with pytest.raises(FlightError, match=r"document: has no chunk 'x'; must be one of 'Chunk 1'"):
        files.chunk(tmp_path / "p.psx", label="x")


def test_two_chunks_in_one_document(tmp_path):
    path = tmp_path / "c.xml"
    both = metashape.chunk() + metashape.chunk().replace("Chunk 1", "Chunk 2")
    path.write_text(f"<document>{both}</document>")
    assert files.chunk(path, label="Chunk 2").others == ("Chunk 1",)
    assert any("other chunks: Chunk 2" in one for one in reading.read(path).left_out)


@pytest.mark.parametrize("path", ["../../secret.zip", "/etc/passwd", "c:/x.zip"])
def test_no_file_outside_the_project_is_opened(tmp_path, path):
    project = tmp_path / "p.psx"
    project.write_text(f'<document version="1.2.0" path="{path}"/>')
    with pytest.raises(FlightError, match="must lie below the project's folder"):
        files.chunk(project)


def test_what_is_no_file_of_metashape_is_told(tmp_path):
    path = tmp_path / "c.xml"
    path.write_text("<kml/>")
    with pytest.raises(FlightError, match=r"c\.xml:1: kml: is no file of Metashape"):
        files.chunk(path)
    path.write_text("<document/>")
    with pytest.raises(FlightError, match="has no <chunk>"):
        files.chunk(path)
    path.write_bytes(b"PK\x03\x04nothing")
    with pytest.raises(FlightError, match="is no ZIP archive"):
        files.chunk(path)
