"""Compiled: search, contact, impact, tyres, joints, the end of a step, the drop test."""
