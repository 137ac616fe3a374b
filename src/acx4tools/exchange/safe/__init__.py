"""Files of strangers: read within limits, or refused in one line that names file, line and element.

`opened` opens a file once, or a member of a ZIP archive; `text_lines` cuts text into cells, and
binary files into records; `json_tree` and `xml_tree` give trees whose every node knows its place.
No entity is expanded, no external reference followed, nothing unpacked onto the disk.
"""
