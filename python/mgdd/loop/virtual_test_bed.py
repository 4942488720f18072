"""A virtual engine whose operating point is steered too: what a map is measured on."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mgdd._core.engine import OperatingPoint
from mgdd.errors import ParameterError, RigError, argument, hinted
from mgdd.loop.plant import Measurement, checked_inputs
from mgdd.loop.virtual_engine import VirtualEngine
from mgdd.presets.meant import CylinderLike, PointLike, engine_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mgdd.optimize import Limit

_SEEDS = 1_000_003  # operating points of one test bed


class VirtualTestBed:
    """A virtual engine whose operating point is an input like the others: a plant for `mgdd.loop.seek_map`.

    Parameters
    ----------
    cylinder : Cylinder, Preset, str or path-like
        As of `VirtualEngine`.
    axes : sequence of str
        Numbers of the operating point that are steered, in the order of the axes of a map.
    point : OperatingPoint, Preset, str, path-like, mapping, or callable, optional
        What the other numbers are; a callable takes the axes by keyword and gives the whole point, as where the charge
        pressure follows the load.
    limits : sequence of str, or limits by name or as Limit
        What to measure beside J, as of `VirtualEngine`.
    seed : int
        Of all noise; each change of the operating point draws anew.
    **settings
        Further settings of `VirtualEngine`.

    Raises
    ------
    mgdd.errors.ParameterError
        An axis that no operating point has, or a setting of the engine outside of its domain.

    Examples
    --------
    >>> from mgdd.loop import VirtualTestBed
    >>> bed = VirtualTestBed("puma_single", limits=["p_max_bar"], seed=1)
    >>> bed.input_names
    ('speed_rpm', 'fuel_mg', 'soc_cad')
    >>> bed.apply({"speed_rpm": 1500.0, "fuel_mg": 20.0, "soc_cad": -5.0})
    >>> bool(95.0 < bed.measure().limits["p_max_bar"] < 110.0)
    True
    """

    def __init__(
        self,
        cylinder: CylinderLike = "puma_single",
        axes: Sequence[str] = ("speed_rpm", "fuel_mg"),
        *,
        point: PointLike | Callable[..., OperatingPoint] | None = None,
        limits: Mapping[str, float] | Sequence[Limit | str] = (),
        seed: int = 0,
        **settings: Any,
    ) -> None:
        self._axes, self._seed, self._settings = tuple(axes), seed, dict(settings)
        known = list(OperatingPoint().to_dict())
        for name in self._axes:
            if name not in known:
                raise ParameterError(
                    hinted(f"{argument('axes')}: {name!r} is not a number of an operating point", name, known)
                )
        self._point = point if callable(point) else None
        given = None if callable(point) else point
        self._cylinder, self._base = engine_of(cylinder, {} if given is None else given)
        first = VirtualEngine(self._cylinder, self._base, limits=limits, seed=seed, **settings)
        self.limit_names = first.limit_names
        self.input_names = (*self._axes, *first.input_names)
        self._visit = 0  # changes of the operating point so far, that the noise of the next one follows from
        self._at: tuple[float, ...] | None = None
        self._bench: VirtualEngine | None = None
        self._wanted: tuple[float, ...] | None = None

    def with_cylinder(self, cylinder: CylinderLike) -> Self:
        """Give the same test bed with another cylinder, as a model of it."""
        return type(self)(
            engine_of(cylinder, self._base)[0], self._axes, point=self._point or self._base,
            limits=self.limit_names, seed=self._seed, **self._settings,
        )  # fmt: skip

    def point_at(self, numbers: Mapping[str, float]) -> OperatingPoint:
        """Give the operating point at numbers of its axes."""
        own = {name: float(numbers[name]) for name in self._axes}
        return self._point(**own) if self._point else self._base.replace(**own)

    def require_cells(self, axes: Mapping[str, Any]) -> None:
        """ParameterError where the engine does not run in some cell of these axes."""
        for numbers in itertools.product(*(np.asarray(column, np.float64).tolist() for column in axes.values())):
            at = dict(zip(axes, numbers, strict=True))
            try:
                VirtualEngine(self._cylinder, self.point_at(at), **self._settings)
            except ParameterError as error:
                where = ", ".join(f"{name} = {value:g}" for name, value in at.items())
                raise ParameterError(f"{argument('axes')} at {where}: {error}") from error

    @property
    def operating_point_changes(self) -> bool:
        """Whether the next cycle runs at another operating point than the last one."""
        return self._wanted is not None and self._wanted[: len(self._axes)] != self._at

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set operating point and inputs of the next cycle, all of `input_names`."""
        self._wanted = checked_inputs(inputs, self.input_names)

    def begin(self, visit: int) -> None:
        """Say that a visit with this number begins: its noise is that of this number, whatever ran before."""
        self._visit, self._bench = visit, None

    def measure(self) -> Measurement:
        """Run one cycle at the point and the inputs applied last."""
        if self._wanted is None:
            raise RigError("measure() before apply(): apply an operating point and a timing first")
        own = len(self._axes)
        if self._bench is None or self.operating_point_changes:
            self._at = self._wanted[:own]
            point = self.point_at(dict(zip(self._axes, self._at, strict=True)))
            seed = (self._seed * _SEEDS + self._visit) % 2**64
            self._bench = VirtualEngine(self._cylinder, point, limits=self.limit_names, seed=seed, **self._settings)
            self._visit += 1
        inputs = dict(zip(self.input_names[own:], self._wanted[own:], strict=True))
        self._bench.apply(inputs)
        measured = self._bench.measure()
        at = dict(zip(self._axes, self._at or (), strict=True))
        return dataclasses.replace(measured, applied={**at, **measured.applied})

    def steady(self, columns: Mapping[str, ArrayLike]) -> dict[str, NDArray[np.float64]]:
        """Give J and limits without noise, each sensor settled, at columns of all inputs; NaN where no cycle runs.

        Parameters
        ----------
        columns : mapping of str to array_like
            All of `input_names`, broadcast together.

        Returns
        -------
        dict
            ``j`` and every limit by name, one number per row.
        """
        every = np.broadcast_arrays(*(np.asarray(columns[name], np.float64) for name in self.input_names))
        table = np.stack([column.ravel() for column in every], axis=1)
        out = np.full((len(table), 1 + len(self.limit_names)), np.nan)
        points, where = np.unique(table[:, : len(self._axes)], axis=0, return_inverse=True)
        for k, at in enumerate(points):
            rows = np.flatnonzero(where.ravel() == k)
            point = self.point_at(dict(zip(self._axes, at, strict=True)))
            engine = VirtualEngine(self._cylinder, point, limits=self.limit_names, **self._settings)
            first, *further = table[rows, len(self._axes) :].T
            run = engine._quiet(0).run_columns(first, list(further))
            out[rows, 0] = run["j"]
            for i in range(len(self.limit_names)):
                out[rows, 1 + i] = np.asarray(run["limits"])[:, i]
        return dict(zip(("j", *self.limit_names), out.T, strict=True))
