"""The report's chapter on which model the points prefer."""

from hysim.paper import markup
from hysim.paper.preference import BOXES, beside_nested, by_nested_sampling, left_out, preference, stored_evidence
from hysim.posterior import EvidenceRow


def preference_chapter(drawn: markup.Drawn) -> str:
    """The evidence of each model."""
    found = stored_evidence()
    boxes = [f"ln evidence, boxes {BOXES[factor]}" for factor in found.factors]
    return (
        markup.paragraph(f"{preference()} {beside_nested()}")
        + markup.paragraph(
            "The evidence of a model is the probability that it gives to the points before it has seen them: the mean "
            "of its likelihood over the priors of its parameters. A model with parameters that the points do not need "
            "spreads its priors over what was not measured, and loses. Priors are flat in the box of the search, and "
            "the points are rounded to pixels, and so is the likelihood. Evidences depend on the boxes, so a "
            "preference counts only where it is the same with all boxes halved, as they are, and doubled, by odds of "
            "3 : 1 after two standard errors. “Duhem, 5 terms” has the terms of the discovered law, and its box "
            "stands about the coefficients that were found: its evidence does not count that search. These figures "
            "are stored, from experiments/49_evidence.py."
        )
        + markup.figure(
            drawn["evidence"],
            "ln of the evidence of each model less that of the best one, with the boxes halved, as they are, and "
            "doubled. Left of the dotted line the odds are less than 1 : 3.",
        )
        + markup.table(
            ["model", "parameters", *boxes, "by nested sampling", "probability", "left-out rmse [µm]"],
            [_cells(row) for row in found.rows],
        )
    )


def _cells(row: EvidenceRow) -> list[str]:
    nested, error = by_nested_sampling().get(row.name), left_out(row.name)
    return [
        row.name,
        str(row.n_parameters),
        *map(_with_error, row.log_evidence, row.error),
        _with_error(*nested) if nested else "–",
        f"{stored_evidence().probabilities()[row.name]:.2g}",
        f"{error.left_out_rmse:.4f}" if error else "–",
    ]


def _with_error(value: float, error: float) -> str:
    return f"{value:.2f} ± {error:.2f}"
