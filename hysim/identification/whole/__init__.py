"""The search for a plant of several parts: part by part, then at once, and what the records tell apart."""
