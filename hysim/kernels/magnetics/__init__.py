"""Steps of laws of magnetic cores."""
