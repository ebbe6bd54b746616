"""How far omega falls because slices may overlap."""
