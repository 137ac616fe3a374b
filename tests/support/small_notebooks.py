"""Small notebooks for the tests of what runs them."""

import nbformat


def write(path, *cells):
    """Write a notebook whose kernel is installed nowhere."""
    made = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in cells])
    made.cells[0].metadata["tags"] = ["parameters"]
    made.metadata["kernelspec"] = {"name": "nowhere", "display_name": "-", "language": "python"}
    path.parent.mkdir(exist_ok=True)
    nbformat.write(made, path)
    return path
