"""Properties of the columns of a record: channels, turning points, cycles, drift, noise, the quantum of a sensor."""
