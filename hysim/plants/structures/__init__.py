"""Structures: masses on linear and hysteretic elements under a moving base or a force."""
