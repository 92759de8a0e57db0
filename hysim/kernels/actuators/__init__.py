"""Outputs of a law through the linear stages of an actuator."""
