"""Roles of models, the abstract law, parameters and search spaces, sums and cascades, and JSON files."""

from hysim.models import cascade, composable, sum

composable.register("+", sum.Sum, sum.SumStructure, "parts")
composable.register(">>", cascade.Cascade, cascade.CascadeStructure, "stages")
