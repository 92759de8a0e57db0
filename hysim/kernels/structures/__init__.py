"""Many masses on elements with memory: exact linear propagation, and sweeps for the rest of the forces."""
