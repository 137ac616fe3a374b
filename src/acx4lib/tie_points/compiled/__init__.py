"""Windows compared, fitted and interpolated, compiled."""
