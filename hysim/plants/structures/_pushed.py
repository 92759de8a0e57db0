"""Slow motions of a structure: loads that grow, and cycles of a displacement."""

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, check_whole, read_only
from hysim.plants.structures._assembled import AssembledStructure
from hysim.plants.structures.static import Frame, StaticResponse, pushed, strokes


class PushedStructure(AssembledStructure):
    """A structure that is pushed slowly."""

    def pushover(self, pattern: npt.ArrayLike, control: npt.ArrayLike, *, at: str = "displacement") -> StaticResponse:
        """Equilibria under loads that grow slowly, told by a displacement.

        ``K x + sum b f(b . x) = factor pattern``. The factor follows from the control, so that the path goes on where
        the structure softens. Between two control values each drift moves straight: dashpots and masses do nothing.

        Parameters
        ----------
        pattern : array, shape (n_nodes,)
            Loads at the masses for a factor of one [N].
        control : array, shape (n,)
            Displacements of what `at` names, one behind the other; the structure begins at `initial_state` [m].
        at : str
            What is controlled: ``"displacement.k"`` of the mass k, by default the last one, or ``"drift.k"``.

        Returns
        -------
        StaticResponse

        Raises
        ------
        SimulationError
            If no equilibrium is found, as where the structure would snap through while the control rests; it names the
            control value.
        ValueError
            If the pattern has not one number for each mass or is zero, a number is not finite, or `at` names neither a
            displacement nor a drift.

        Examples
        --------
        >>> import hysim as hs
        >>> column = hs.MaxwellSlip(stiffness=(90.0,), slips=(0.01,), feedthrough=10.0)
        >>> frame = hs.shear_frame([1.0, 1.0], laws=column)
        >>> push = frame.pushover([1.0, 2.0], [0.01, 0.02, 0.04])
        >>> push.base_shear.round(6).tolist()
        [0.6, 1.03125, 1.21875]
        """
        loads = read_only(pattern, "pattern", ndim=1)
        if loads.size != self.n_nodes:
            raise ValueError(f"pattern must hold one number for each of {self.n_nodes} masses, got {loads.size}")
        values = read_only(control, "control", ndim=1)
        return pushed(self._at_rest, self._first_displacements, loads, self._controlled(at), lambda begin: values)

    def cyclic(
        self,
        protocol: npt.ArrayLike,
        pattern: npt.ArrayLike | None = None,
        *,
        at: str = "displacement",
        steps: int = 50,
    ) -> StaticResponse:
        """Equilibria along slow cycles, as of a test with a jack.

        Parameters
        ----------
        protocol : array, shape (n,)
            Turning points of what `at` names, such as 0, 1, -1, 2, -2, 0 times the displacement at yield [m].
        pattern : array, shape (n_nodes,), optional
            Loads at the masses for a factor of one; by default a jack at what is controlled: one newton at the mass,
            or at both ends of the element.
        at : str
            As of `pushover`.
        steps : int
            Equal steps of each stroke.

        Returns
        -------
        StaticResponse
            It begins with the displacement of `initial_state`. Errors are those of `pushover`.

        Examples
        --------
        >>> import hysim as hs
        >>> column = hs.MaxwellSlip(stiffness=(90.0,), slips=(0.01,), feedthrough=10.0)
        >>> test = hs.shear_frame([1.0], laws=column).cyclic([0.02, -0.02, 0.0], steps=2)
        >>> test.control.tolist(), test.factor.round(6).tolist()
        ([0.0, 0.01, 0.02, 0.0, -0.02, -0.01, 0.0], [0.0, 1.0, 1.1, -0.9, -1.1, -0.1, 0.9])
        """
        check_whole(steps, "steps")
        turns, row = read_only(protocol, "protocol", ndim=1), self._controlled(at)
        loads = row if pattern is None else read_only(pattern, "pattern", ndim=1)
        if loads.size != self.n_nodes:
            raise ValueError(f"pattern must hold one number for each of {self.n_nodes} masses, got {loads.size}")
        return pushed(self._at_rest, self._first_displacements, loads, row, lambda begin: strokes(turns, begin, steps))

    @property
    def _at_rest(self) -> Frame:
        return Frame(self.stiffness_matrix, self.drift_matrix, self.laws, self.elastic_slopes)

    @property
    def _first_displacements(self) -> FloatArray:
        return np.array(self.initial_state[: self.n_nodes] or np.zeros(self.n_nodes))

    def _controlled(self, at: str) -> FloatArray:
        """Direction of a displacement or a drift, shape (n_nodes,)."""
        name, place = self.place_of(at)
        if name not in ("displacement", "drift"):
            raise ValueError(f'what is controlled must be a "displacement" or a "drift", got {at!r}')
        return np.asarray(self.drift_matrix[place] if name == "drift" else np.eye(self.n_nodes)[place])
