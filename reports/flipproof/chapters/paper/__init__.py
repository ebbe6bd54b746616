"""The paper's figures and statements, by three equations; they do not depend on the throw of the report."""
