"""Noise of the recordings: autocorrelation, drift, lines, outliers, offsets, scatter of ensembles."""
