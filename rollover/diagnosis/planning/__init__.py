"""Tests before they are made: what they would show, which effects they would tell apart, and what to measure next."""
