"""Does a controller in C give the commands that it gave in Python, whatever law it inverts?

For each law that has an inverse, a `TrackingController` with this inverse and an integral closes a loop of 20 000
samples around the law, with a noisy sensor, voltage limits narrower than the reference asks for, and noise in the
reference. The references and measurements that the loop recorded are then replayed through the controller as `hs.to_c`
writes it, compiled by the C compiler. The commands are compared in parts of their range.
"""

import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import one_panel, write_results
from step_runners import program_output

RESULTS = Path(__file__).parent / "results" / "controllers_in_c"
SAMPLES = 20_000
H = 1e-3  # s
LIMITS = (-0.8, 0.8)
PLAYS = hs.PrandtlIshlinskii(thresholds=(0.0, 0.2, 0.5), weights=(1.0, 0.5, 0.3), offset=0.1)
LAWS: dict[str, Any] = {
    "Bouc-Wen, n = 1": hs.BoucWen(beta=0.6, gamma=0.3, feedthrough=1.0, gain=0.4, offset=-0.1, z0=0.2),
    "Bouc-Wen, n = 2": hs.BoucWen(n=2.0, feedthrough=1.0, gain=-0.4),
    "Bouc-Wen, n = 1.6": hs.BoucWen(n=1.6, feedthrough=-1.0, gain=0.4),
    "polynomial Bouc-Wen": hs.PolynomialBoucWen(beta=0.4, gamma=0.4, gain=0.3, input_coefficients=(0.6, 0.1, 0.02)),
    "Zhu-Wang": hs.ZhuWangBoucWen(delta=0.1, n=1.5, input_coefficients=(2.0, 0.1)),
    "generalised Bouc-Wen": hs.GeneralizedBoucWen(n=1.5, gain=-0.3, input_coefficients=(1.0,)),
    "Baber-Noori": hs.BoucWenBaberNoori(delta_nu=0.2, delta_eta=0.1, input_coefficients=(1.0,)),
    "Duhem": hs.Duhem.from_terms({"u'": 1.0, "u' |z|": -0.3, "|u'| z": -0.6}, feedthrough=2.0),
    "Dahl": hs.Dahl(stiffness=2.0, coulomb=4.0),
    "Coleman-Hodgdon": hs.ColemanHodgdon(alpha=0.8, c=1.0, B=0.7),
    "line": hs.Line(offset=0.2, slope=-0.7),
    "Prandtl-Ishlinskii": PLAYS,
    "modified Prandtl-Ishlinskii": hs.ModifiedPrandtlIshlinskii(
        thresholds=(0.0, 0.2), weights=(1.0, 0.5), dead_zones=(-0.4, 0.0, 0.3), dead_zone_weights=(0.2, 1.0, 0.4)
    ),
    "generalised Prandtl-Ishlinskii": hs.GeneralizedPrandtlIshlinskii(
        thresholds=(0.0, 0.2), weights=(1.0, 0.5), left=(1.0, 1.0, 0.0, 0.0, 0.5)
    ),
    "parametric Prandtl-Ishlinskii": hs.ParametricPrandtlIshlinskii(
        exponent=-0.5, decay=0.3, weight=0.4, weight_slope=0.1, input_coefficients=(1.0, 0.05, 0.05), reach=2.0
    ),
    "rate-dependent Prandtl-Ishlinskii": hs.RateDependentPrandtlIshlinskii(
        thresholds=(0.0, 0.2), weights=(1.0, 0.5), beta=1e-4
    ),
    "Maxwell slip": hs.MaxwellSlip(stiffness=(1.0, 0.5), slips=(9.0, 0.4)),
    "stop": hs.Stop(threshold=9.0),
    "Preisach": hs.Preisach.from_density(np.linspace(-3.0, 3.0, 8), lambda a, b: 1.0 + 0.1 * (a - b)),
    "sum": hs.Dahl(coulomb=0.5) + PLAYS + hs.Line(slope=1.0),
    "cascade": hs.BoucWen(n=1.6, feedthrough=1.0, gain=0.4) >> PLAYS,
}
Row = dict[str, Any]
Array = NDArray[np.float64]


def ends_of(law: Any) -> tuple[float, float]:
    """Outputs at the inputs -1 and 1."""
    at_rate = law.at(H) if isinstance(law, hs.RateDependentPrandtlIshlinskii) else law
    _, low, high = at_rate.response([0.0, -1.0, 1.0]).tolist()
    return low, high


def reference(law: Any, samples: int) -> Array:
    """A sine with noise between the outputs at the inputs -1 and 1, which the limits do not reach."""
    ends = np.array(ends_of(law))
    middle, amplitude = float(ends.mean()), 0.5 * float(np.ptp(ends))
    noise = 0.01 * amplitude * np.random.default_rng(0).standard_normal(samples)
    return middle + 0.9 * amplitude * np.sin(2.0 * np.pi * np.arange(samples) / 1000.0) + noise


def row(name: str, law: Any, samples: int, compiler: str, folder: Path) -> Row:
    """The worst difference between the voltages in C and in Python, and how often they are at a limit."""
    wanted = reference(law, samples)
    amplitude = float(np.ptp(wanted))
    stage = hs.Actuator(hysteresis=law, sensor=hs.Sensor(noise=1e-3 * amplitude))
    low, high = ends_of(law)
    slope = 2.0 / (high - low)
    controller = hs.TrackingController(
        feedforward=hs.InverseFeedforward(law=law), feedback=hs.PID(kp=0.05 * slope, ki=5.0 * slope), limits=LIMITS
    )
    run = hs.close_loop(stage, controller, H * np.arange(samples), wanted)
    code = hs.to_c(controller, H, name="controller", y0=float(run.y[0]))
    given = program_output(compiler, code, np.stack([wanted, run.measurement]), folder)
    difference = np.abs(given - run.drive)
    return {
        "law": name,
        "samples": samples,
        "at_limits_percent": 100.0 * float(np.mean((run.drive == LIMITS[0]) | (run.drive == LIMITS[1]))),
        "worst_difference": float(difference.max() / np.ptp(run.drive)),
        "equal_bits_percent": 100.0 * float(np.mean(difference == 0.0)),
        "state_bytes": 8 * code.state_size,
        "lines": code.source.count("\n"),
    }


def main(smoke: bool = False) -> list[Row]:
    """Replay each controller, print, and write table, figure and result."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise SystemExit("there is no C compiler here")
    laws = {name: LAWS[name] for name in ("line",)} if smoke else LAWS
    rows = []
    for name, law in laws.items():
        with tempfile.TemporaryDirectory() as folder:
            rows.append(row(name, law, 500 if smoke else SAMPLES, compiler, Path(folder)))
        print(
            "{law:34s} at limits {at_limits_percent:5.1f} %  worst difference {worst_difference:.1e}  "
            "equal bits {equal_bits_percent:6.2f} %  {lines:5d} lines  state {state_bytes:6d} bytes".format(**rows[-1])
        )
    differences = [each["worst_difference"] for each in rows]
    numbers = {
        "laws": len(rows),
        "samples": SAMPLES,
        "worst_difference": max(differences),
        "median_difference": float(np.median(differences)),
        "least_at_limits_percent": min(each["at_limits_percent"] for each in rows),
    }
    return write_results(RESULTS, rows, draw, numbers, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """Worst difference of each law."""
    canvas, ax = one_panel(0.22 * len(rows) + 0.8)
    places = np.arange(len(rows))[::-1]
    ax.plot([max(each["worst_difference"], 1e-17) for each in rows], places, "o")
    ax.axvline(1e-12, color="black", linestyle=":")
    ax.set(xscale="log", xlim=(4e-18, 1e-11), xlabel="worst difference / range (1e-17: equal bits)")
    ax.set_yticks(places, [each["law"] for each in rows])
    return canvas


if __name__ == "__main__":
    main()
