"""The one result of a fit, whatever was fitted, and what every fitted model can do."""

from __future__ import annotations

import html
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, Self, runtime_checkable

from mgdd.errors import DataError
from mgdd.results.finding import Finding, findings_html
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import to_jsonable
from mgdd.results.result import Result, merged

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr
    from numpy.typing import NDArray


@runtime_checkable
class Model(Protocol):
    """A model with sampled inputs and outputs: it runs free, predicts ahead, and is written to a file.

    Inputs and records are a Dataset, a DataFrame or a mapping of columns; ``time_s`` [s] is one of them.
    """

    @property
    def kind(self) -> str:
        """Name of the structure, as it stands in a file."""

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Values by name; the name ends in the unit."""

    def simulate(
        self, inputs: Any, *, initial_state: Mapping[str, float] | Sequence[float] | None = None
    ) -> xr.Dataset:
        """Run free from a state, at rest without one; entry k of an input acts from ``time_s[k]`` to the next."""

    def predict(self, record: Any, horizon: int) -> xr.Dataset:
        """Predict `horizon` samples ahead of every sample of a record, from its data up to that sample."""

    def to_toml(self) -> str:
        """Write the model as TOML, with the standard errors and figures of the fit that it comes from."""

    @classmethod
    def from_toml(cls, text: str) -> Self:
        """Read what `to_toml` wrote."""


ARRIVED = 1.005  # a start within 0.5 % of the best error counts as having found it


@dataclass(frozen=True, kw_only=True)
class FitQuality:
    """How closely a model follows one record.

    Parameters
    ----------
    nrmse_fit_percent : float or None
        ``100 (1 - |y - yh| / |y - mean y|)`` [%]: 100 is perfect, 0 as good as the mean; None where it is undefined.
    rmse : float
        Root of the mean squared error, in `unit`.
    unit : str
        Unit of the error.
    n : int
        Samples that were compared.
    """

    nrmse_fit_percent: float | None
    rmse: float
    unit: str
    n: int

    def __str__(self) -> str:
        percent = "" if self.nrmse_fit_percent is None else f"{self.nrmse_fit_percent:.2f} %, "
        return f"{percent}RMSE {self.rmse:.4g} {'' if self.unit == '-' else self.unit}".rstrip()

    def to_dict(self) -> dict[str, Any]:
        """Give the figures as plain values."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Fit(Result):
    """The result of a fit: the model, how well it follows its records, and what the data leave open.

    Parameters
    ----------
    report : FitReport
        Estimates, standard errors, correlation and history of the best search.
    model : object
        What was fitted, ready to simulate.
    kind : str
        Name of the model's structure.
    train, test : FitQuality or None
        Free run over the record that was fitted, and over another one.
    checked_by : str
        How `train` and `test` were computed where it was not a free run, for example ``"leave-one-out"``.
    findings : tuple of Finding
        Limitations found, and which measurement would resolve them.
    unidentifiable : tuple of str
        Parameters that the data do not determine.
    source : str
        Name of the record.
    start_rmse : tuple of float
        Error of the search from every start, the best first; infinite where one failed.
    n_best : int
        Searches that ended at the best fit: where one of many did, a better fit may exist.
    start_reports : tuple of FitReport
        Reports of all searches in the order of the starts, where they are kept.
    run : xarray.Dataset or None
        The free run over the training record, beside the measurement.
    draw : callable or None
        What `plot` calls: ``draw(fit, ax)``.

    See Also
    --------
    mgdd.identify.identify_throttle, mgdd.identify.fit_cylinder, mgdd.identify.fit_model : make one.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import OdeModel, fit_model
    >>> time = np.linspace(0.0, 10.0, 201)
    >>> y = 2.0 * (1.0 - np.exp(-time / 0.5))
    >>> start = OdeModel(derivative=lambda t, x, u, p: (p[0] * u[0] - x) / p[1],
    ...                  parameters={"gain": 1.0, "time_s": 1.0}, initial_state=(0.0,))
    >>> fit = fit_model(start, {"time_s": time, "u": np.ones(201), "y": y})
    >>> round(fit.parameters["gain"], 3), fit.train.nrmse_fit_percent > 99.9
    (2.0, True)
    """

    report: FitReport
    model: Any
    kind: str
    train: FitQuality | None = None
    test: FitQuality | None = None
    checked_by: str = "free-run"
    findings: tuple[Finding, ...] = ()
    unidentifiable: tuple[str, ...] = ()
    source: str = "record"
    start_rmse: tuple[float, ...] = ()
    n_best: int = 1
    start_reports: tuple[FitReport, ...] = ()
    run: xr.Dataset | None = None
    draw: Callable[[Any, Any], Any] | None = field(default=None)

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters of the model by name; the estimates where it does not name its own."""
        own = getattr(self.model, "parameters", None)
        return own if own is not None else dict(zip(self.report.names, self.report.values.tolist(), strict=True))

    @property
    def residual(self) -> NDArray[np.float64]:
        """Residual of the report at the estimates."""
        return self.report.residual

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the free parameters, as in the report."""
        return self.report.covariance

    @property
    def success(self) -> bool:
        """Whether the best search met a tolerance."""
        return self.report.success

    @property
    def dataset(self) -> xr.Dataset:
        """Estimates, correlation and what was simulated; everything of `to_dict` as attributes."""
        import xarray as xr

        parts = [part for name in self.__dataclass_fields__ if isinstance(part := getattr(self, name), xr.Dataset)]
        attrs = {
            name: json.dumps(value) if isinstance(value, dict | list) else str(value)
            for name, value in self.to_dict().items()
            if value is not None
        }
        return merged(self.report.dataset, *parts, attrs=attrs)

    @property
    def stderr(self) -> dict[str, float]:
        """Standard errors of the estimated parameters by name."""
        return dict(zip(self.report.names, self.report.stderr.tolist(), strict=True))

    def __repr__(self) -> str:
        quality = [f"{name} {q}" for name, q in (("train", self.train), ("test", self.test)) if q is not None]
        return f"<Fit {', '.join([self.kind, self.report.status, *quality])}>"

    def summary(self) -> str:
        """Return a human-readable summary.

        Returns
        -------
        str
            Quality, the table of the report, the outcome of the starts, and the findings.
        """
        lines = [self._headline(), "", self.report.summary()]
        if len(self.start_rmse) > 1:
            lines += ["", f"{self.n_best} of {len(self.start_rmse)} searches ended at the best fit"]
        extra = self._extra()
        return "\n".join([*lines, *(["", "findings:", *(f"  {finding}" for finding in extra)] if extra else [])])

    def _draw(self, ax: Any) -> Any:
        if self.draw is None:
            raise DataError(f"a fit of {self.kind} keeps no run to draw: simulate its model")
        return self.draw(self, ax)

    def predict(self, *given: Any, **options: Any) -> xr.Dataset:
        """Predict with the model.

        Parameters
        ----------
        *given, **options
            As ``predict`` of `model` takes them: points of a response, or a record and the samples ahead of a throttle.

        Returns
        -------
        xarray.Dataset
            As ``predict`` of `model` gives it.

        Raises
        ------
        DataError
            A model that does not predict, as a cylinder: `mgdd.engine.simulate` takes it.
        """
        predict = getattr(self.model, "predict", None)
        if predict is None:
            raise DataError(f"{type(self.model).__name__} has no predict: simulate it, with the model of this fit")
        made: xr.Dataset = predict(*given, **options)
        return made

    def to_dict(self) -> dict[str, Any]:
        """Give everything but residual, model and run as plain values that `json.dumps` takes.

        Returns
        -------
        dict
            Arrays become lists; infinite and NaN numbers become None.
        """
        report = {name: getattr(self.report, name) for name in ("status", "message", "success", "rmse", "nit", "nfev")}
        plain: dict[str, Any] = to_jsonable(
            {
                "kind": self.kind,
                "source": self.source,
                "train": None if self.train is None else self.train.to_dict(),
                "test": None if self.test is None else self.test.to_dict(),
                "parameters": self.parameters,
                "stderr": self.stderr,
                "unidentifiable": self.unidentifiable,
                "findings": [finding.to_dict() for finding in self.findings],
                "n_best": self.n_best,
                "start_rmse": self.start_rmse,
                **report,
            }
        )
        return plain

    def to_toml(self) -> str:
        """Write the model as TOML with the standard errors, the quality and the name of the record.

        Returns
        -------
        str
            Text that ``from_toml`` of the model reads.

        Raises
        ------
        DataError
            A model that has no such file.
        """
        give = getattr(self.model, "to_parameters", None)
        if give is None:
            raise DataError(f"{type(self.model).__name__} has no parameter file: keep the parameters of to_dict()")
        made = give()
        if "parameters" not in made.tables:  # a response, whose file has its points: they give what the fit would
            return str(made.to_toml())
        units = dict.fromkeys(("fit_percent_train", "fit_percent_test"), "%")
        units["rmse_test"] = "-" if self.test is None else self.test.unit
        file = made.with_fit(
            stderr=self.stderr,
            figures={name: (value, units[name]) for name, value in figures_of(self).items() if value is not None},
            source=f"fitted to {self.source}",
            unidentifiable=self.unidentifiable,
        )
        text: str = file.to_toml()
        return text

    def _repr_html_(self) -> str:
        head = f"<p><b>{html.escape(self._headline())}</b></p>"
        return f"<div>{head}{self.report._repr_html_()}{findings_html('findings', self._extra())}</div>"

    def _headline(self) -> str:
        quality = [f"{name} {q}" for name, q in (("train", self.train), ("test", self.test)) if q is not None]
        checked = f": {self.checked_by} fit {', '.join(quality)}" if quality else ""
        return f"{self.kind} fitted to {self.source}{checked}{'' if self.test else ', no test record'}"

    def _extra(self) -> list[Finding]:
        return [finding for finding in self.findings if finding not in self.report.findings]


def figures_of(fit: Fit) -> dict[str, float | None]:
    """Give the quality of a fit in the words of its file and of the command line."""
    train, test = fit.train, fit.test
    return {
        "fit_percent_train": None if train is None else train.nrmse_fit_percent,
        "fit_percent_test": None if test is None else test.nrmse_fit_percent,
        "rmse_test": None if test is None else test.rmse,
    }


def n_best_of(rmse: tuple[float, ...]) -> int:
    """Count the searches whose error is within 0.5 % of the best."""
    best = min(rmse, default=0.0)
    return sum(error <= ARRIVED * best for error in rmse)
