"""How far a small change of the release moves a flight."""
