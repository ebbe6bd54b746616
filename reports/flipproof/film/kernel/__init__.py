"""The compiled loops of a film's fit."""
