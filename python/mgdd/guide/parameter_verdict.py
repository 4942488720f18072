"""What the data determine of one parameter of an online calibration."""

from __future__ import annotations

from dataclasses import dataclass

from mgdd.results.result import NumbersResult


@dataclass(frozen=True, kw_only=True, repr=False)
class ParameterVerdict(NumbersResult):
    """How much one parameter of an online calibration deserves belief.

    Attributes
    ----------
    name : str
        Of the parameter.
    value, standard_error : float
        Estimate, and its standard error with everything that is not known exactly counted.
    knowledge : str
        ``"determined"``, ``"uncertain"``, ``"held"`` (the data know less than was known beforehand), ``"at bound"``,
        ``"contradicted"`` (the model does not fit this pressure) or ``"no data"``.
    sentence : str
        All of it in words, with the reason.

    Examples
    --------
    >>> from mgdd.guide import OnlineCalibration
    >>> OnlineCalibration("puma_single").verdicts["wall_heat_scale"].knowledge
    'no data'
    """

    name: str
    value: float
    standard_error: float
    knowledge: str
    sentence: str
