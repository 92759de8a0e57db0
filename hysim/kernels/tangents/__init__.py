"""Derivatives of steps need this beside the steps: rules of functions, and one more step of each iteration."""
