"""Whether the equations are solved right: an independent integration, and a second method, of the paper's own throw."""
