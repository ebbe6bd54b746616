"""Ice: nothing moves inside the bottle, so every change of omega is the solver's own."""
