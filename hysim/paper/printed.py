"""The numbers that the paper prints, as text: the last digit of each says how finely it was rounded.

Source: B. B. Muhammad, M. H. Rahman, M. R. Ahmad and M. Bashir, "A novel model of PZT actuator and its
application in hysteresis and vibration controls", Jurnal Teknologi (2016). Matrices are rows of texts;
polynomials run from the highest power of s. Tables 1 and 2 are in `hysim.datasets`.
"""

Row = tuple[str, ...]
Matrix = tuple[Row, ...]

# Section 2.2: Table 1
POINTS_LOADING, POINTS_UNLOADING = "26", "26"
RANGE_V: Row = ("0", "125")
LAST_DIGIT_UM = "0.001"
"""In which Tables 1 and 2 give displacements."""

# Section 2.3: the model of Table 1, equation (1)
NUM_1: Row = ("0.07962", "0.1521")
DEN_1: Row = ("1", "2.201", "7.816", "8.423", "6.93")
POLES_1: Matrix = (("-0.4185", "2.2833"), ("-0.6817", "0.9063"))
"""Real and imaginary part of each pair."""
FIT_1 = "91.5"
FPE_1 = "0.00586989"

# Section 2.4: the experiment, and the amplifier of equations (2) and (3)
ON_MS, OFF_MS = "5000", "5000"
FREQUENCY_HZ = "1.01626"
LOW_V, HIGH_V = "18", "50"
INPUT_V, OUTPUT_V = "5", "50"
RESISTORS_IN_TEXT, RESISTORS_IN_FIGURE_8 = ("R_f", "R_2"), ("R_1", "R_2")
RATIO = "9"
SLEW_RATE_V_PER_US = "0.5"
BANDWIDTH_KHZ = "15.91"

# Section 2.5: the model of Table 2, equations (4) and (6)
NUM_4: Row = ("-0.02777", "-0.06457")
DEN_4: Row = ("1", "0.1157", "0.2176")
NUM_6: Row = ("-0.0722",)
DEN_6: Row = ("1", "0.1187", "0.243")

# Section 2.6: state space, equations (7), (8), (10), (12) to (16); B is (1, 0) in both models
A_7: Matrix = (("-1.1577", "-2.6439"), ("1", "0"))
C_8: Matrix = (("0", "0.0579"),)
CONTROLLABILITY_10: Matrix = (("1", "-1.1577"), ("0", "1"))
OBSERVABILITY_12: Matrix = (("0", "0.0579"), ("0.0579", "0"))
A_13: Matrix = (("-0.1187", "-2.430"), ("1", "0"))
C_14: Matrix = (("0", "-0.0722"),)
CONTROLLABILITY_15: Matrix = (("1", "-0.1187"), ("0", "1"))
OBSERVABILITY_16: Matrix = (("0", "-0.0722"), ("-0.0722", "0"))
B: Matrix = (("1",), ("0",))
RANK = "2"

# Abstract and section 4
HYSTERESIS_REDUCTION = "90"
VIBRATION_REDUCTION = "97"

# Introduction and references
CITED_REDUCTION = "33"
LAST_CITED, LAST_LISTED = "31", "30"
BAT_SEARCH_CITED, BAT_SEARCH_LISTED = "14", "13"


def floats(row: Row) -> tuple[float, ...]:
    """The numbers of a row."""
    return tuple(float(text) for text in row)
