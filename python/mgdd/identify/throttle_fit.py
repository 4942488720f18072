"""What an identified throttle hands back, and what any model of a throttle can be asked."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from mgdd.io.parameters import ParameterFile, entries
from mgdd.results import to_jsonable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from mgdd.optimize import FitReport

__all__ = ["KINDS", "ThrottleFit", "ThrottleModel"]

KINDS = ("first_principle", "pw_r", "pw_w", "pw_p")


@runtime_checkable
class ThrottleModel(Protocol):
    """A throttle model that can run free and predict ahead: first-principle or pseudo-Wiener.

    Examples
    --------
    >>> from mgdd.identify import ThrottleModel
    >>> isinstance(3.0, ThrottleModel)
    False
    """

    @property
    def kind(self) -> str:
        """One of ``first_principle``, ``pw_r``, ``pw_w``, ``pw_p``."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values by name; the name ends in the unit."""

    def simulate(self, time_s: ArrayLike, duty: ArrayLike, *, start_deg: float) -> NDArray[np.float64]:
        """Run free: entry k is the angle [deg] at ``time_s[k]``; ``duty[k]`` acts from there to the next sample."""

    def predict(self, time_s: ArrayLike, duty: ArrayLike, angle_deg: ArrayLike, horizon: int) -> NDArray[np.float64]:
        """Predict `horizon` samples ahead: entry k is the angle [deg] at sample k + horizon from data up to k."""

    def to_parameters(self) -> ParameterFile:
        """Give everything that changes a result; ``to_toml`` writes it."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ThrottleFit:
    """An identified throttle: the model, how well it follows the log, and what the log left open.

    The names of SciPy's results (``x``, ``fun``, ``cost``, ``nfev``, ``njev``, ``nit``, ``status``, ``message``,
    ``success``) are those of `report`.

    Parameters
    ----------
    report : mgdd.optimize.FitReport
        Estimates, standard errors, correlation, history.
    model : ThrottleModel
        The fitted model, ready to simulate.
    kind : str
        One of ``first_principle``, ``pw_r``, ``pw_w``, ``pw_p``.
    fit_percent_train : float
        Free-run fit on the log it was fitted to [%].
    fit_percent_test : float or None
        Free-run fit on another log [%].
    rmse_test_deg : float or None
        Free-run error on that log [deg].
    parameters : mapping of str to float
        All parameters of the model; the names end in their units.
    unidentifiable : tuple of str
        Names that the log does not determine.
    findings : tuple of str
        What to distrust and which excitation would settle it, in words.
    source : str
        Name of the log.

    See Also
    --------
    identify_throttle : makes one.

    Examples
    --------
    >>> from mgdd.identify import ThrottleFit
    >>> "fit_percent_test" in ThrottleFit.__dataclass_fields__
    True
    """

    report: FitReport
    model: ThrottleModel
    kind: str
    fit_percent_train: float
    fit_percent_test: float | None = None
    rmse_test_deg: float | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    unidentifiable: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    source: str = "log"

    @property
    def x(self) -> NDArray[np.float64]:
        """Estimates of the free parameters in the order of ``report.names``."""
        return self.report.x

    @property
    def fun(self) -> NDArray[np.float64]:
        """Residual at the estimate."""
        return self.report.fun

    @property
    def cost(self) -> float:
        """Half the sum of squares."""
        return self.report.cost

    @property
    def nfev(self) -> int:
        """Residual evaluations."""
        return self.report.nfev

    @property
    def njev(self) -> int:
        """Jacobian evaluations."""
        return self.report.njev

    @property
    def nit(self) -> int:
        """Trial steps."""
        return self.report.nit

    @property
    def status(self) -> str:
        """Status of the solver."""
        return self.report.status

    @property
    def message(self) -> str:
        """The status as a sentence."""
        return self.report.message

    @property
    def success(self) -> bool:
        """Whether a tolerance was met."""
        return self.report.success

    def __repr__(self) -> str:
        test = "" if self.fit_percent_test is None else f", test {self.fit_percent_test:.2f} %"
        return f"<ThrottleFit {self.kind}, {self.status}, train {self.fit_percent_train:.2f} %{test}>"

    def to_parameters(self) -> ParameterFile:
        """Give the model with standard errors, fit and name of the log, as `to_toml` writes them.

        Returns
        -------
        mgdd.io.ParameterFile
            Of the kind of the model; ``load_throttle_model`` makes the model again.
        """
        file = self.model.to_parameters()
        errors = dict(zip(self.report.names, self.report.stderr.tolist(), strict=True))
        known = {
            name: errors[own]
            for name in file.tables["parameters"]
            if (own := _fitted_name(name, errors)) is not None and math.isfinite(errors[own])
        }
        parameters = {name: replace(entry, stderr=known.get(name)) for name, entry in file.tables["parameters"].items()}
        figures = {name: getattr(self, name) for name in ("fit_percent_train", "fit_percent_test", "rmse_test_deg")}
        fit = entries({name: value for name, value in figures.items() if value is not None})
        for name in ("fit_percent_train", "fit_percent_test"):
            if name in fit:
                fit[name] = replace(fit[name], unit="%")
        return replace(
            file,
            tables={**file.tables, "parameters": parameters, "fit": fit},
            notes={"source": f"fitted to {self.source}", "unidentifiable": list(self.unidentifiable)},
        )

    def to_toml(self) -> str:
        """Write the model as TOML with units, standard errors and the name of the log.

        Returns
        -------
        str
            Text that `load_throttle_model` and ``from_toml`` of the model read.
        """
        return self.to_parameters().to_toml()

    def to_dict(self) -> dict[str, Any]:
        """Give everything but residual and model as plain Python values.

        Returns
        -------
        dict
            With ``fit_percent_train``, ``fit_percent_test``, ``rmse_test``, ``parameters``, ``unidentifiable``,
            ``findings``, ``stderr`` and the solver's figures.
        """
        plain: dict[str, Any] = to_jsonable(
            {
                "model": self.kind,
                "source": self.source,
                "fit_percent_train": self.fit_percent_train,
                "fit_percent_test": self.fit_percent_test,
                "rmse_test": self.rmse_test_deg,
                "parameters": self.parameters,
                "stderr": dict(zip(self.report.names, self.report.stderr.tolist(), strict=True)),
                "unidentifiable": self.unidentifiable,
                "findings": self.findings,
                "status": self.status,
                "success": self.success,
                "nit": self.nit,
                "nfev": self.nfev,
            }
        )
        return plain

    def summary(self) -> str:
        """Say in a page how good the fit is and what is open.

        Returns
        -------
        str
            Figures, the table of the report, and the findings.
        """
        return "\n".join([self._headline(), "", self.report.summary(), *self._notes()])

    def _headline(self) -> str:
        test = "no test log"
        if self.fit_percent_test is not None:
            error = "" if self.rmse_test_deg is None else f", RMSE {self.rmse_test_deg:.4g} deg"
            test = f"test {self.fit_percent_test:.2f} %{error}"
        return f"{self.kind} fitted to {self.source}: free-run fit train {self.fit_percent_train:.2f} %, {test}"

    def _notes(self) -> list[str]:
        extra = [finding for finding in self.findings if finding not in self.report.findings]
        return ["", "findings:", *(f"  {finding}" for finding in extra)] if extra else []

    def _repr_html_(self) -> str:
        extra = [finding for finding in self.findings if finding not in self.report.findings]
        items = "".join(f"<li>{html.escape(finding)}</li>" for finding in extra)
        notes = f"<p>findings:</p><ul>{items}</ul>" if extra else ""
        return f"<div><p><b>{html.escape(self._headline())}</b></p>{self.report._repr_html_()}{notes}</div>"


def _fitted_name(name: str, fitted: Mapping[str, float]) -> str | None:
    """Return the fitted parameter that a model's parameter follows; sides that share one drop their prefix."""
    shared = name.removeprefix("above_").removeprefix("below_")
    return name if name in fitted else shared if shared in fitted else None
