"""Parameters fitted to recordings: linearisation, least squares, time shifts, scans, cross-validation."""
