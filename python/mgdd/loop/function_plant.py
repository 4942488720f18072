"""A function of your own as a plant: in Python, or compiled."""

from __future__ import annotations

import copy
import ctypes
import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError, RigError
from mgdd.loop.plant import Measurement, checked_inputs
from mgdd.optimize import Seeker
from mgdd.optimize.inputs import by_name_or_number

C_TYPE = ctypes.CFUNCTYPE(
    ctypes.c_int,
    ctypes.POINTER(ctypes.c_double), ctypes.c_size_t, ctypes.POINTER(ctypes.c_double), ctypes.c_size_t, ctypes.c_void_p,
)  # fmt: skip
_TAKES = "int (const double *inputs, size_t n_inputs, double *outputs, size_t n_outputs, void *user_data)"
_CFuncPtr: Any = C_TYPE.__mro__[1]


def address_of(function: Any) -> int | None:
    """Give the address of a compiled function; None for anything else."""
    if isinstance(function, bool):
        return None
    if isinstance(function, int | np.integer):
        address = int(function)
    elif isinstance(function, _CFuncPtr):
        address = _of_ctypes(function, function)
    elif isinstance(getattr(function, "address", None), int) and hasattr(function, "ctypes"):  # numba.cfunc
        address = _of_ctypes(function, function.ctypes)
    else:
        return None
    if not 0 < address < 2 ** (8 * ctypes.sizeof(ctypes.c_void_p)):
        raise ParameterError.of("function", function, "the address of a function, not null")
    return address


def data_address_of(user_data: Any) -> int:
    """Give the address that the function gets as its last argument; ParameterError for what has none."""
    if user_data is None:
        return 0
    if isinstance(user_data, int | np.integer) and not isinstance(user_data, bool) and user_data >= 0:
        return int(user_data)
    if isinstance(user_data, np.ndarray) and user_data.flags.c_contiguous:
        return int(user_data.ctypes.data)
    if isinstance(user_data, ctypes.Array | ctypes.Structure):
        return ctypes.addressof(user_data)
    raise ParameterError.of("user_data", user_data, "a contiguous array, a ctypes array or structure, or an address")


def _of_ctypes(shown: Any, function: Any) -> int:
    takes, gives = function.argtypes, function.restype
    if takes is None:
        raise ParameterError(
            f"function = {shown!r}: its argtypes are not declared; give FunctionPlant.C_TYPE((name, library))"
        )
    fits = len(takes) == 5 and _number(gives, ctypes.c_int) and takes[4] is ctypes.c_void_p
    fits = fits and all(_doubles(takes[k]) and _number(takes[k + 1], ctypes.c_size_t) for k in (0, 2))
    if not fits:
        names = ", ".join(getattr(kind, "__name__", str(kind)) for kind in takes)
        given = f"{getattr(gives, '__name__', gives)} ({names})"
        raise ParameterError(f"function: its signature is {given}: must be {_TAKES}")
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def _doubles(kind: Any) -> bool:
    return getattr(kind, "_type_", None) is ctypes.c_double


def _number(kind: Any, like: Any) -> bool:
    """Whether it is a whole number of that width, with a sign or without."""
    code = getattr(kind, "_type_", None)
    return isinstance(code, str) and code in "iIlLqQ" and ctypes.sizeof(kind) == ctypes.sizeof(like)


_FORMS = "return J, or (J, {limit: value}), or None for a failed cycle"


class FunctionPlant:
    """A function of your own as a plant: in Python, or compiled.

    A Python function takes inputs by name, or as plain numbers in their order, and gives J, or J and limits by name, or
    None for a failed cycle. A compiled one runs in loops of the core, without the GIL and on all cores. It is ``int
    f(const double *inputs, size_t n_inputs, double *outputs, size_t n_outputs, void *user_data)``: it reads the inputs
    in their order, writes J and then the limits, and returns 0. Any other status, a number that is not finite or beyond
    1e30, and one that is not written make a failed cycle.

    Parameters
    ----------
    function : callable, int, or compiled function
        ``function({"soc_cad": -6.0}) -> J``, or ``-> (J, {"p_max_bar": 96.0})``. Compiled: a ctypes function of type
        ``FunctionPlant.C_TYPE``, a `numba.cfunc`, or a bare address as a number, whose
        signature cannot be checked and whose code the caller keeps alive. Loops call it on threads of their own,
        `monte_carlo` on several at once. A ctypes callback of a Python function takes the GIL in every cycle; an
        exception in it is a failed cycle.
    inputs : sequence of str
        Names of the inputs, one to eight.
    limits : sequence of str
        Names of the limits that it has to give, at most eight of a compiled function.
    values : sequence of str
        Names of quantities that it gives instead of J: in one mapping together with the limits, compiled before them.
    user_data : numpy array, ctypes array or structure, or int, optional
        Whose address a compiled function gets as its last argument.
    noise_sd : float
        Standard deviation of Gaussian noise that is added to J [unit of J].
    seed : int
        Of that noise, in [0, 2**64); it depends on seed and cycle alone.

    Raises
    ------
    mgdd.errors.ParameterError
        Null or another signature, a setting outside its domain.

    Examples
    --------
    >>> from mgdd.loop import FunctionPlant
    >>> plant = FunctionPlant(lambda x: 56.0 - 0.03 * x["soc_cad"] ** 2, ["soc_cad"])
    >>> plant.apply({"soc_cad": -10.0})
    >>> plant.measure().performance
    53.0
    """

    C_TYPE = C_TYPE

    def __init__(
        self,
        function: Any,
        inputs: Sequence[str],
        limits: Sequence[str] = (),
        *,
        values: Sequence[str] = (),
        user_data: Any = None,
        noise_sd: float = 0.0,
        seed: int = 0,
    ) -> None:
        for name, given in (("inputs", inputs), ("limits", limits), ("values", values)):
            if isinstance(given, str) or len(set(given)) != len(given):
                raise ParameterError.of(name, given, "a sequence of different names")
        ParameterError.unless(0 <= seed < 2**64, "seed", seed, "in [0, 2**64)")
        ParameterError.unless(math.isfinite(noise_sd) and noise_sd >= 0.0, "noise_sd", noise_sd, "finite and >= 0")
        if noise_sd > 0.0 and values:
            raise ParameterError("noise_sd and values were both given: noise is added to J, and there is none")
        self._function, self._values, self._user_data = function, tuple(values), user_data  # kept alive
        self._noise_sd, self._seed, self._cycle = float(noise_sd), int(seed), 0
        self.input_names, self.limit_names = tuple(inputs), tuple(limits)
        self._applied: dict[str, float] | None = None
        self._of_a_number = False
        self._core: _core.loop.FunctionPlant | None = None
        if (address := address_of(function)) is not None:
            self._core = _core.loop.FunctionPlant(
                address, data_address_of(user_data), inputs=len(self.input_names), values=len(self._values) or 1,
                limits=list(self.limit_names), noise_sd=self._noise_sd, seed=self._seed,
            )  # fmt: skip
        elif not callable(function):
            raise ParameterError.of("function", function, "a function of the inputs by name, or a compiled one")
        elif user_data is not None:
            raise ParameterError("user_data: goes to a compiled function; bind it to one in Python")

    @property
    def cycle(self) -> int:
        """Index of the next cycle."""
        return self._cycle if self._core is None else self._core.cycle

    @property
    def compiled(self) -> bool:
        """Whether loops of the core can run it: a compiled function that gives J."""
        return self._core is not None and not self._values

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs of the next call."""
        self._applied = dict(zip(self.input_names, checked_inputs(inputs, self.input_names), strict=True))

    def measure(self) -> Measurement:
        """Call the function at the inputs applied last.

        Returns
        -------
        Measurement
            J with its noise, or the values, and the limits; NaN in a failed cycle, which is a misfire.
        """
        if self._applied is None:
            raise RigError("measure() before apply(): apply inputs first")
        if self._core is not None:
            return self._measurement(self._core.measure([*self._applied.values()]))
        measured = self._answer(self._called(dict(self._applied)))
        self._cycle += 1
        return measured

    def _called(self, inputs: dict[str, float]) -> Any:
        """Call the function by name; one of a plain number shows itself at the first cycle."""
        if self._of_a_number:
            return self._function(*inputs.values())
        if self._cycle:
            return self._function(inputs)
        try:
            answer, self._of_a_number = by_name_or_number(self._function, inputs)
        except TypeError as error:
            form = ", ".join(f"x[{name!r}]" for name in self.input_names)
            raise ParameterError(
                f"function: takes one mapping of inputs by name, write lambda x: ... {form}: {error}"
            ) from error
        return answer

    def _measurement(self, outputs: Sequence[float] | None) -> Measurement:
        if outputs is None:
            return self._failed()
        limits = dict(zip(self.limit_names, outputs[len(self._values) or 1 :], strict=True))
        if not self._values:
            return Measurement(components=(outputs[0],), limits=limits)
        return Measurement(values=dict(zip(self._values, outputs, strict=False)) | limits, limits=limits)

    def _failed(self) -> Measurement:
        return Measurement(components=(math.nan,), limits=dict.fromkeys(self.limit_names, math.nan), misfire=True)

    def _answer(self, answer: Any) -> Measurement:
        if answer is None:
            return self._failed()
        if self._values:
            return self._named(answer)
        j, limits = answer if isinstance(answer, tuple) and len(answer) == 2 else (answer, {})
        number = self._number("J", j)
        if self._noise_sd > 0.0:
            number += self._noise_sd * _core.loop.plant_noise(self._seed, self._cycle)
        if not isinstance(limits, Mapping) or set(self.limit_names) - set(limits):
            gave = ", ".join(map(str, limits)) if isinstance(limits, Mapping) else repr(limits)
            raise DataError(
                f"limits = {gave or 'none'}{self._where()}: must name {', '.join(self.limit_names) or 'none'}; {_FORMS}"
            )
        return Measurement(
            components=(number,), limits={name: self._number(name, limits[name]) for name in self.limit_names}
        )

    def _named(self, answer: Any) -> Measurement:
        names = (*self._values, *self.limit_names)
        if not isinstance(answer, Mapping) or set(names) - set(answer):
            raise DataError(f"function gave {answer!r}{self._where()}: must map {', '.join(names)} to numbers")
        numbers = {name: self._number(name, answer[name]) for name in names}
        return Measurement(values=numbers, limits={name: numbers[name] for name in self.limit_names})

    def _number(self, name: str, value: Any) -> float:
        number = getattr(value, "item", lambda: value)() if getattr(value, "ndim", 1) == 0 else value
        if not isinstance(number, Real) or not math.isfinite(number):
            raise DataError(f"{name} = {value!r}{self._where()}: must be a finite number; {_FORMS}")
        return float(number)

    def _where(self) -> str:
        return " at " + ", ".join(f"{name} = {value:.6g}" for name, value in (self._applied or {}).items())

    def __deepcopy__(self, memo: dict[int, Any]) -> FunctionPlant:
        made = object.__new__(type(self))
        shared = () if self._core is None else ("_function", "_user_data")  # which may not be copied
        for name, value in vars(self).items():
            vars(made)[name] = value if name in shared else copy.deepcopy(value, memo)
        return made

    def __copy__(self) -> FunctionPlant:
        return self.__deepcopy__({})

    def __getstate__(self) -> dict[str, Any]:
        if self._core is not None:
            raise TypeError("a FunctionPlant of a compiled function works in this process only: take threads")
        return vars(self)

    def __repr__(self) -> str:
        what = "Python" if self._core is None else "compiled"
        return f"<FunctionPlant of {', '.join(self.input_names)}, {what}>"


def core_of(plant: Any, seeker: Seeker) -> _core.loop.FunctionPlant | None:
    """Give what a loop of the core runs with that seeker; None where the loop has to run in Python."""
    if not isinstance(plant, FunctionPlant) or not plant.compiled:
        return None
    alike = tuple(seeker.input_names) in ((), plant.input_names) and tuple(seeker.limit_names) == plant.limit_names
    return plant._core if alike and seeker.component_count == 1 else None
