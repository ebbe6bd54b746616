"""The paper under test: its parameters, its figures and what it says about them."""
