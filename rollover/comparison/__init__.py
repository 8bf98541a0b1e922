"""Measured beside simulated: instruments, alignment in time, residuals, ratings, two runs side by side."""
