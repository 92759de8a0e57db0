"""A functional mock-up unit describes the model, is the same bytes each time, and does in FMPy what the law does."""

import dataclasses
import io
import math
import shutil
import subprocess
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

import hysim as hs
from hysim.export import _compilers, _fmu
from hysim.export._program import Field, Program

VERSIONS = ("2.0", "3.0")
LAW = hs.Dahl(stiffness=2.0, coulomb=0.5, offset=0.1, z0=0.2)
DAHL = """
static void dahl_pack(const double *fields, double *parameters, double *state)
{
    parameters[0] = fields[0];
    parameters[1] = fields[1];
    parameters[2] = fields[2];
    state[1] = fields[3];
}

static void dahl_start(const double *parameters, double *state, double u0)
{
    (void)parameters;
    state[0] = u0;
}

static double dahl_step(const double *parameters, double *state, double u)
{
    const double way = u - state[0], side = way < 0.0 ? -1.0 : 1.0, end = side * parameters[1];

    state[1] = end + (state[1] - end) * exp(-parameters[0] / parameters[1] * fabs(way));
    state[0] = u;
    return parameters[2] + state[1];
}
"""
FIELDS = (
    Field("stiffness", 2.0, 1e-4, 1e5, log=True, unit="y/u"),
    Field("coulomb", 0.5, 1e-2, 1e2, log=True, unit="y"),
    Field("offset", 0.1, -math.inf, math.inf, unit="y"),
    Field("z0", 0.2, -1.0, 1.0, unit="y"),
)
FRICTION = Program(
    source=DAHL,
    step="dahl_step",
    inputs=("u",),
    output="y",
    parameters=np.array([2.0, 0.5, 0.1]),
    state=np.array([0.0, 0.2]),
    start="dahl_start",
    fields=FIELDS,
    pack="dahl_pack",
    memory=2,
)
INTEGRATOR = Program(
    source="static double sum(const double *p, double *s, double r, double m) { return s[0] += p[0] * (r - m); }",
    step="sum",
    inputs=("reference", "measurement"),
    output="command",
    parameters=np.array([0.5]),
    state=np.array([1.0]),
    sample_time=0.01,
)
UNITS = {"u": "mm", "y": "N"}
needs_compiler = pytest.mark.skipif(shutil.which("gcc") is None and shutil.which("clang") is None, reason="no compiler")


def unit(folder, program=FRICTION, version="2.0", platforms=None, u0=0.0):
    """A unit in a file."""
    path = folder / f"{program.step}{version[0]}.fmu"
    path.write_bytes(_fmu.archive(program, _fmu.Options("Friction", version, platforms, UNITS, u0)))
    return path
