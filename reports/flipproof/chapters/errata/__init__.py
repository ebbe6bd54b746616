"""Errata: what the paper prints against what follows from its own earlier equations."""
