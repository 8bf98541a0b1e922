"""Frozen answers: a corpus of sealed campaigns by fixed seeds, made by one version and compared with any other."""
