"""What the calibration is worth on the ground: `check_points`."""
