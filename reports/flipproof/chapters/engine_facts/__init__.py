"""Engine behaviour that a user may not expect, measured anew with every report."""
