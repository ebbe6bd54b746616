"""Events: the impacts of two flights side by side, and one curve in the tube around the other."""
