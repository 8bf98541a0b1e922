"""Codes for roll-over protective structures: formulae, clauses, requirements, loading sequences."""
