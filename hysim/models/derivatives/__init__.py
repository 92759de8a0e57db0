"""Exact derivatives of responses: steps in forward mode, and the Jacobian by the numbers of a law."""
