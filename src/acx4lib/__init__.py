"""In-flight calibration of multi-head aerial cameras for direct georeferencing.

Conventions, each implemented once, in `geometry`:

- ``R_a_b`` takes components from frame b to frame a, ``r_a_b`` is the origin of b in a, and a
  pose ``T_a_b`` holds both; inner letters touch: ``T_m_c = T_m_b @ T_b_c``.
- Frames: m mapping (topocentric, east north up), b body (the IMU's: forward, left, up),
  c camera (x right, y up, z away from the ground), h head, s synthetic camera, e earth-centred.
- omega, phi, kappa are the paper's eq. (6), M = R3(kappa) R2(phi) R1(omega), object to image;
  ``rotation_from_opk`` returns its transpose, camera to object.
- Image coordinates are in mm from the middle of the image, x right, y up; pixels count from the
  centre of the top-left one, col to the right, row down.
- Distortion is a function of the measured point and is subtracted from it, eqs (1)-(2), (7)-(11).
- Lengths in m, in the image in mm; angles in radians; v = estimated less observed.

Models and solvers: arrays in, values out. What reads and writes files is `acx4files`; few
functions are enough for most programs, and `acx4` has them.
"""
