"""A surrogate of a measured engine as a plant of the loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mgdd.errors import ParameterError, RigError
from mgdd.loop.plant import Measurement, checked_inputs
from mgdd.surrogate import SurrogateEngine

__all__ = ["SurrogatePlant"]


class SurrogatePlant:
    """A virtual measured engine that a seeker can steer: inputs of its injection, an objective of its signals.

    Parameters
    ----------
    engine : SurrogateEngine
        The engine; it advances by one cycle per measurement.
    objective : str or mapping of str to float
        A signal, or the weight of each signal; every weighted signal is one component of J.
    limits : sequence of str
        Signals to report as limits.
    inputs : sequence of str
        Which inputs of the surrogate are steered, ``soi_cad`` first; the others keep the engine's values.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown signal or input.

    Examples
    --------
    >>> from mgdd.loop import SurrogatePlant, run_seeker
    >>> from mgdd.optimize import GradientDescent
    >>> from mgdd.surrogate import SurrogateEngine, fit_surrogate, random_step_records
    >>> engine = SurrogateEngine(fit_surrogate(random_step_records(1500)), residuals=False)
    >>> plant = SurrogatePlant(engine, "imep_bar", limits=["mprr"])
    >>> plant.apply({"soi_cad": -4.0})
    >>> sorted(plant.measure().limits)
    ['mprr']
    """

    def __init__(
        self,
        engine: SurrogateEngine,
        objective: str | Mapping[str, float] = "imep_bar",
        *,
        limits: Sequence[str] = (),
        inputs: Sequence[str] = ("soi_cad",),
    ) -> None:
        surrogate = engine.surrogate
        self._weights = {objective: 1.0} if isinstance(objective, str) else dict(objective)
        if not self._weights:
            raise ParameterError("objective = {}: must name at least one signal")
        for what, names in (("objective", self._weights), ("limits", limits)):
            for name in names:
                if name not in surrogate.signals:
                    raise ParameterError(f"{what}: {name!r} is not a signal: must be one of {list(surrogate.signals)}")
        known = tuple(surrogate.support.inputs)
        if tuple(inputs)[:1] != ("soi_cad",) or len(set(inputs)) < len(inputs) or not set(inputs) <= set(known):
            raise ParameterError(
                f"inputs = {list(inputs)}: must begin with soi_cad and be among {list(known)}, once each"
            )
        self.engine = engine
        self._limits, self._inputs = tuple(limits), tuple(inputs)
        self._applied: tuple[float, ...] | None = None

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the steered inputs."""
        return self._inputs

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limited signals."""
        return self._limits

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the injection of the next cycle.

        Parameters
        ----------
        inputs : mapping of str to float
            One number per name of `input_names`, in its unit.

        Raises
        ------
        mgdd.errors.ParameterError
            A missing, unknown or non-finite input.
        """
        self._applied = checked_inputs(inputs, self._inputs)

    def measure(self) -> Measurement:
        """Run one cycle at the inputs applied last.

        Returns
        -------
        Measurement
            ``values`` holds the reading of every signal, and ``supported`` as 0 or 1.

        Raises
        ------
        mgdd.errors.RigError
            Nothing was applied yet.
        mgdd.errors.ParameterError
            Inputs outside the support, for an engine with ``outside="raise"``.
        """
        if self._applied is None:
            raise RigError("measure() before apply(): apply the inputs first")
        soi, *others = self._applied
        reading = self.engine.step(soi, dict(zip(self._inputs[1:], others, strict=True)))
        return Measurement(
            components=tuple(weight * float(reading[name]) for name, weight in self._weights.items()),
            limits={name: float(reading[name]) for name in self._limits},
            values={name: float(value) for name, value in reading.items()},
        )
