"""What version 0.1 wrote: models with their responses, an identification, a stored study. Run it with that version.

python tests/data/version_0_1/generate.py
"""

import json
import sys
from pathlib import Path

import numpy as np

import hysim as hs

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent.parent))

from test_model_storage import MODELS  # noqa: E402

U = np.append(0.0, np.sin(np.linspace(0.0, 20.0, 60)) * np.linspace(0.2, 1.0, 60))


def bump(a: float, b: float) -> dict[str, float]:
    """A task of two numbers."""
    return {"height": a * np.exp(-b * b), "width": b}


def main() -> None:
    """Write the fixtures beside this file."""
    models = []
    for model in MODELS:
        hs.save(model, HERE / "model.json", units={"u": "V", "y": "um"})
        text = (HERE / "model.json").read_text()
        (HERE / "model.json").unlink()
        try:
            y = hs.simulate(model, 1e-3 * np.arange(U.size), U).y.tolist()
        except (TypeError, ValueError, AttributeError, hs.SimulationError):  # a controller, or a law that diverges
            y = None
        models.append({"text": text, "y": y})
    (HERE / "models.json").write_text(json.dumps({"u": U.tolist(), "models": models}, indent=0) + "\n")
    record = hs.Record(
        u=U, y=hs.BoucWen(beta=0.7, feedthrough=0.4).response(U) + 1e-3 * np.cos(7.0 * np.arange(U.size))
    )
    (HERE / "identification.json").write_text(hs.identify(hs.BoucWen, record, fixed={"n": 1.0}).to_json() + "\n")
    (HERE / "study.sqlite").unlink(missing_ok=True)
    hs.sweep(bump, {"a": [1.0, 2.0], "b": [0.0, 0.5, 1.0]}, store=HERE / "study.sqlite", workers=1)


if __name__ == "__main__":
    main()
