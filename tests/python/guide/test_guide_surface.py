"""A rough model in front of the Gaussian process, in each of its forms, and the bad ones."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from mgdd.errors import ParameterError, ShapeError
from mgdd.optimize import ComponentLag, GaussianProcessSeeking, Seeker
from mgdd.surrogate import fit_response

BOUNDS = {"soc_cad": (-25.0, 15.0), "egr": (0.0, 0.4)}
START = {"soc_cad": 4.0, "egr": 0.31}


def guide(x: Any) -> float:
    return 7.0 - 0.04 * (x["soc_cad"] + 12.0) ** 2 - 400.0 * (x["egr"] - 0.28) ** 2


def plant(x: Any) -> float:
    return (
        50.0
        - 0.03 * (x["soc_cad"] + 4.0) ** 2
        - 300.0 * (x["egr"] - 0.2) ** 2
        - 2.0 * (x["soc_cad"] + 4.0) * (x["egr"] - 0.2)
    )


def made(**settings: Any) -> GaussianProcessSeeking:
    return GaussianProcessSeeking(**{"start": START, "inputs": BOUNDS, "seed": 4, **settings})


def grid(soc: Any, egr: Any) -> xr.DataArray:
    values = [[guide({"soc_cad": s, "egr": e}) for s in soc] for e in egr]
    return xr.DataArray(values, coords={"egr": egr, "soc_cad": soc}, dims=("egr", "soc_cad"))


def fitted() -> Any:
    rng = np.random.default_rng(2)
    soc, egr = rng.uniform(-25, 15, 40), rng.uniform(0, 0.4, 40)
    values = [guide({"soc_cad": s, "egr": e}) for s, e in zip(soc, egr, strict=True)]
    return fit_response({"soc_cad": soc, "egr": egr, "imep_bar": values}, "imep_bar", degree=2)


FORMS = {
    "function": lambda: guide,
    "function of plain numbers": lambda: lambda soc, egr: guide({"soc_cad": soc, "egr": egr}),
    "map": lambda: grid(np.linspace(-25, 15, 17), np.linspace(0.0, 0.4, 17)),
    "map, turned": lambda: grid(np.linspace(15, -25, 17), np.linspace(0.0, 0.4, 17)),
    "fit": fitted,
    "model of a fit": lambda: fitted().model,
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_says_the_same(form: str) -> None:
    (surface,) = made(guide=FORMS[form]()).settings["guide"]
    assert [len(axis) for axis in surface.axes] == [17, 17]
    for soc, egr in ((-17.3, 0.11), (3.9, 0.37)):
        assert surface([soc, egr]) == pytest.approx(guide({"soc_cad": soc, "egr": egr}), abs=1e-6)


def test_it_saves_readings_and_is_learnt() -> None:
    plain, guided = made(), made(guide=guide)
    lost = [[50.0 - plant(dict(zip(BOUNDS, row, strict=True))) for row in one.run(plant, 8)["estimate"].values]
            for one in (plain, guided)]  # fmt: skip
    assert lost[1][-1] < 0.05 < lost[0][4]
    assert 0.2 < guided.guide_factor[0] < 1.5
    assert plain.guide_factor == []


def test_it_goes_on_from_a_file_and_a_pickle(tmp_path: Path) -> None:
    one = made(
        guide=guide, limits={"p_max_bar": 150.0}, limit_guides={"p_max_bar": lambda x: 90.0 - 2.0 * x["soc_cad"]}
    )
    one.run(lambda x: (plant(x), {"p_max_bar": 100.0 - x["soc_cad"]}), 6)
    one.save(tmp_path / "seeker.json")
    for again in (Seeker.load(tmp_path / "seeker.json"), pickle.loads(pickle.dumps(one))):
        assert again.settings == one.settings
        assert again.ask() == one.ask()


def test_inputs_without_names_and_components() -> None:
    seeker = GaussianProcessSeeking(
        start=[4.0, 0.31], bounds=([-25.0, 0.0], [15.0, 0.4]),
        components=[ComponentLag(), ComponentLag(delay_cycles=3.0)],
        guide=[lambda x: -0.03 * (x[0] + 6.0) ** 2, lambda x: -200.0 * (x[1] - 0.25) ** 2],
    )  # fmt: skip
    nox = [-200.0 * 0.11**2] * 3
    for _ in range(40):
        x = seeker.ask()
        nox.append(-200.0 * (x[1] - 0.2) ** 2)
        seeker.tell([-0.03 * (x[0] + 4.0) ** 2, nox.pop(0)])
    assert seeker.estimate[0] == pytest.approx(-4.0, abs=1.0)
    assert seeker.estimate[1] == pytest.approx(0.2, abs=0.02)
    assert seeker.delay_cycles == [0.0, 3.0]


def raising(x: Any) -> float:
    if x["egr"] > 0.31:
        raise ValueError("lambda below one")
    return 1.0 + x["soc_cad"]


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no guide": ({"guide": "curve.json"}, r"guide = 'curve.json': must be a callable"),
    "fails": ({"guide": raising}, r"guide fails at soc_cad = -25, egr = 0.325: lambda below one"),
    "nan": (
        {"guide": lambda x: float("nan") if x["soc_cad"] > 0 else 1.0},
        r"guide gives nan at soc_cad = 2.5, egr = 0"),
    "by name": ({"guide": {"soc_cad": guide}}, r"guide = \{.*must be a callable of the inputs"),
    "no number": ({"guide": lambda _: "x"}, r"guide fails at"),
    "the same": ({"guide": lambda _: 4.0}, r"guide.*same everywhere"),
    "a gap": (
        {"guide": grid([-25.0, 15.0], [0.0, 0.4]).where(lambda a: a.egr < 0.3)},
        r"guide has no value at .*egr = 0.4",
    ),
    "other inputs": ({"guide": grid([-25.0, 15.0], [0.0, 0.4]).rename(egr="boost")}, r"must be over soc_cad, egr"),
    "no coordinates": ({"guide": grid([-25.0, 15.0], [0.0, 0.4]).drop_vars("egr")}, r"egr has no coordinates"),
    "two": ({"guide": [guide, guide]}, r"guide has 2 entries"),
    "unknown limit": ({"limits": {"p": 1.0}, "limit_guides": {"q": guide}}, r"limit_guides names q: the limits are p"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_guide_that_cannot_be_is_refused_by_name(case: str) -> None:
    settings, said = REFUSED[case]
    with pytest.raises((ParameterError, ShapeError), match=said):
        made(**settings)


def test_more_than_five_inputs_have_no_guide() -> None:
    inputs = {f"x{k}": (0.0, 1.0) for k in range(6)}
    with pytest.raises(ShapeError, match="one to five inputs"):
        GaussianProcessSeeking(start=dict.fromkeys(inputs, 0.5), inputs=inputs, guide=lambda _: 1.0)
