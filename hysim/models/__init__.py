"""Laws, plants and chain stages: frozen specifications, one family a file."""

from hysim.models import cascade, composable, sum

composable.register("+", sum.Sum, sum.SumStructure, "parts")
composable.register(">>", cascade.Cascade, cascade.CascadeStructure, "stages")
