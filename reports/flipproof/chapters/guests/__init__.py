"""Guests: solvers of other people in a report, certified first, then held against the ladder on the report's throw."""
