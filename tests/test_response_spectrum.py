"""Response spectra: elastic ones in closed form, and strengths whose ductility single simulations confirm."""

from dataclasses import replace

import numpy as np
import pytest
from strategies import assert_refused, refused

import hysim as hs
from hysim.plants.structures import structure as module

DT, PERIODS = 0.02, np.array([0.1, 0.3, 0.7, 1.6])
QUAKES = [hs.signals.ground_motion(3.0, duration=d, sample_time=DT, seed=k) for k, d in enumerate((6.0, 10.0))]
LAWS = [hs.Bilinear(stiffness=40.0, hardening=2.0, yield_input=0.2), hs.MenegottoPinto(stiffness=40.0, yield_input=0.2)]


def spectrum(quakes=QUAKES, periods=PERIODS, law=LAWS[0], yield_input=0.2, **options):
    return hs.response_spectrum(quakes, DT, periods, law=law, yield_input=yield_input, **options)


@pytest.mark.parametrize("damping", [0.0, 0.2])
def test_elastic_peaks_under_a_step_and_a_triangle_are_those_of_the_closed_form(damping):
    """Some peaks lie between samples, and those under the triangle after the record."""
    T, share = np.array([0.07, 0.4, 1.1]), np.sqrt(1.0 - damping**2)
    step = hs.response_spectrum(np.ones(200), DT, T, damping=damping)
    assert step.pseudo_acceleration[0] == pytest.approx(1.0 + np.exp(-np.pi * damping / share), rel=1e-10)
    t, s = np.linspace(0.0, 1.0, 200_001)[:, np.newaxis] * (DT + T), 2.0 * np.pi / T * complex(-damping, share)
    ramps = [((x > 0.0) * (np.exp(s * x) - 1.0 - s * x) / s**2).imag / s.imag for x in (t, t - DT, t - 2.0 * DT)]
    triangle = np.abs(ramps[0] - 2.0 * ramps[1] + ramps[2]).max(axis=0) / DT
    peaks = hs.response_spectrum([0.0, 1.0], DT, T, damping=damping).displacement[0]
    assert peaks == pytest.approx(triangle, rel=1e-8)  # which this grid may miss by 1e-9


@pytest.mark.parametrize("law", LAWS)
def test_single_simulations_of_the_strengths_have_the_ductility(law):
    result = spectrum(law=law, ductility=3.0)
    for k, j in np.ndindex(result.ductility.shape):
        quake, square = np.append(QUAKES[k], np.zeros(80)), (PERIODS[j] / (2.0 * np.pi)) ** 2
        own = replace(law, yield_input=result.pseudo_acceleration[k, j] * square)
        frame = hs.shear_frame([40.0 * square], laws=own, damping=hs.ModalDamping(ratio=0.05))
        peak = hs.simulate(frame, hs.signals.sample_times(quake.size, DT), quake).peaks["drift"][0]
        assert result.displacement[k, j] == pytest.approx(peak, rel=1e-5)
        assert peak == pytest.approx(3.0 * result.pseudo_acceleration[k, j] * square, rel=1e-5)
    assert spectrum(law=law, strength=result.pseudo_acceleration).ductility == pytest.approx(result.ductility, rel=1e-9)


def test_ductility_1_is_elastic_and_records_of_any_length_stand_alone():
    one, elastic = spectrum(ductility=1.0), hs.response_spectrum(QUAKES, DT, PERIODS)
    assert one.displacement == pytest.approx(elastic.displacement, rel=1e-5)  # near T = 5 dt peaks err by 1e-6
    both, alone = spectrum(ductility=3.0, workers=2), spectrum(QUAKES[0], PERIODS[::-1], ductility=3.0)
    assert np.array_equal(alone.pseudo_acceleration[0, ::-1], both.pseudo_acceleration[0])


def test_no_greater_strength_has_the_ductility_and_one_that_none_has_is_refused(monkeypatch):
    result = spectrum(periods=[0.3], ductility=2.5)
    stronger = np.geomspace(1.0001, 3.0, 400) * result.pseudo_acceleration
    assert (spectrum(periods=np.full(400, 0.3), strength=stronger).ductility < 2.5).all()
    monkeypatch.setattr(module, "_MOST", 0.5)
    assert_refused("no strength has this ductility", spectrum, ductility=8.0)


def test_where_the_ductility_jumps_the_strength_is_the_one_before_the_jump():
    """Beyond 6 times the yield point the force of this spring has changed its sign: it does not come back."""
    law = hs.MaxwellSlip(stiffness=(1.2,), slips=(1.0,), feedthrough=-0.2)
    long = {"quakes": [np.append(a, np.zeros(200)) for a in QUAKES], "periods": [0.1], "law": law, "yield_input": 1.0}
    result = spectrum(**long, ductility=50.0)
    assert result.ductility == pytest.approx(np.full((2, 1), 5.98), rel=5e-3)  # the nearer to 6, the longer it stays
    assert np.isinf(spectrum(**long, strength=(1.0 - 1e-6) * result.pseudo_acceleration).ductility).all()


def test_it_is_printed_and_drawn():
    result = spectrum(ductility=2.0)
    assert "medians of 2 records, 4 periods, damping 0.05" in repr(result)
    assert str(result).splitlines()[2].split()[0::3] == ["0.1", "2"]
    ax = hs.plot.spectrum({"two": result}, hs.plot.figure().add_subplot(), quantity="reduction_factor")
    assert np.array_equal(ax.lines[0].get_ydata(), result.reduction_factor.min(axis=0))


test_wrong_arguments_are_named = refused(
    ({"periods": [0.5, 0.0]}, "periods must be positive"),
    ({"periods": [0.5, 1e-9], "strength": 1.0}, "a sample would take 6.98e.08 sub-steps"),
    ({"periods": [0.5, 1e9]}, "periods of up to 1e.09 s need .* zeros after a record"),
    ({"damping": 1.0}, "damping must be from 0 to below 1"),
    ({"ductility": 0.9}, "ductility at least 1, got 0.05 and 0.9"),
    ({"ductility": 2.0, "strength": 1.0}, "either ductility= or strength="),
    ({"strength": [1.0, -1.0, 1.0, 1.0]}, "strength must be positive"),
    ({"ductility": 2.0, "law": hs.Line(slope=-1.0)}, "one positive stiffness on both sides"),
    ({"ductility": 2.0, "law": hs.Line(slope=1.0, offset=0.1)}, "no force at rest"),
    ({"ductility": 2.0, "law": 3.0}, TypeError, "law"),
    ({"ductility": 2.0, "quakes": [[1.0], [0.0]]}, "record 1 of ground_accelerations is zero"),
    call=lambda options: spectrum(**options),
)
