"""What a run says: loads, ledger, standards, clearance, stability, and the folder that keeps it."""
