"""Which effects: screening, score tests, stepwise and pairwise search, decision."""
