"""Sliders without a browser: a value that is set redraws the picture and the numbers."""

from __future__ import annotations

import sys
from typing import Any

import pytest

from mgdd.engine import simulate
from mgdd.maps import CalibrationMap
from mgdd.report import explore

pytest.importorskip("ipywidgets")


def test_a_slider_moves_the_cycle() -> None:
    sliders, picture, text = explore("puma_single", {"fuel_mg": 18.0}).children
    soc, fuel, speed = sliders.children
    assert [own.description for own in sliders.children] == [
        "start of combustion [°CA aTDC]",
        "fuel [mg]",
        "speed [rpm]",
    ]
    before = bytes(picture.value)
    assert before.startswith(b"\x89PNG")
    soc.value, fuel.value, speed.value = -12.0, 25.0, 2000.0
    assert picture.value != before
    cycle = simulate("puma_single", soc_cad=-12.0, fuel_mg=25.0, speed_rpm=2000.0)
    assert text.value.split("<br>") == [
        f"gross IMEP (-180 to 180 °CA): {float(cycle['imep_gross_bar']):.4g} bar",
        f"CA50, angle of 50 % heat released: {float(cycle['ca50_cad']):.4g} °CA aTDC",
        f"maximum pressure: {float(cycle['p_max_bar']):.4g} bar",
    ]
    for own, end in ((soc, soc.max), (fuel, fuel.min), (speed, speed.min)):  # the ends are allowed
        own.value = end


@pytest.mark.parametrize(
    ("axes", "values", "there", "said"),
    [
        ({"speed_rpm": [900, 1500, 3000], "fuel_mg": [6, 20]}, [[-1, -4], [-2, -6], [-5, -9]], (1200.0, 13.0), "-3.25"),
        ({"fuel_mg": [6, 20]}, [-1, -4], (13.0,), "-2.5"),
    ],
)
def test_a_slider_moves_on_the_map(axes: Any, values: Any, there: tuple[float, ...], said: str) -> None:
    sliders, picture, text = explore(CalibrationMap(axes, values, name="soc_cad")).children
    assert [(own.min, own.max) for own in sliders.children] == [(own[0], own[-1]) for own in axes.values()]
    for slider, value in zip(sliders.children, there, strict=True):
        slider.value = slider.min
        before, slider.value = bytes(picture.value), value
        assert picture.value != before
    assert text.value == f"start of combustion: {said} °CA aTDC"


def test_the_extra_is_named_where_widgets_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    with pytest.raises(ImportError, match=r'pip install "mgdd\[interactive\]"'):
        explore("puma_single")
