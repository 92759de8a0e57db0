"""Laws of magnetic cores: the flux density B, or the magnetisation M, for a field H."""
