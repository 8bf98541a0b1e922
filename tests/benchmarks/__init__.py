"""Speed: ratios taken in one run, printed rather than asserted."""
