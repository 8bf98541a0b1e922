"""Recordings as a dataset: whitening, onsets, quantisation, doubts about their conditions."""
