"""What stands on a disk: flights, results, images, and files of other programs.

`flight` reads a flight's folder and checks it; `conventions` finds readings that would fit better,
`results` writes and reads a results folder, and `images` makes synthetic images of files;
`exchange` reads and writes other programs' files, `measuring` makes image points of pictures, and
`stages` goes from a flight to its results, a function a stage. All stand on `acx4lib`, which needs
none of them.
"""
