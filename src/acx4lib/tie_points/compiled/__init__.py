"""Windows of two images compared, fitted and interpolated, compiled."""
