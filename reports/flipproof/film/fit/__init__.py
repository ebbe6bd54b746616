"""From a measured flight back to drag and restitution: one measurement, one equation, estimates with intervals."""
