"""Likelihoods of many parameter sets at once, and an identified problem put together again."""
