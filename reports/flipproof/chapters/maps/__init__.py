"""For which bottles which assumption matters: maps over fill fraction and damping, step or restitution."""
