"""Files of strangers: read within limits, or refused in one line that names file, line and element.

`opened` opens a file once; `text_lines` cuts text into cells, `json_tree` and `xml_tree` give trees
whose every node knows its place, `records` reads binary files, `archive` a member of a ZIP archive.
No entity is expanded, no external reference followed, nothing unpacked onto the disk.
"""
