"""Parameters from recordings: least squares, identifiability, ground laws from force and sinkage."""
