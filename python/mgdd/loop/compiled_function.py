"""Where a compiled function stands in memory, with a look at its signature."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from mgdd.errors import ParameterError

C_TYPE = ctypes.CFUNCTYPE(
    ctypes.c_int,
    ctypes.POINTER(ctypes.c_double), ctypes.c_size_t, ctypes.POINTER(ctypes.c_double), ctypes.c_size_t, ctypes.c_void_p,
)  # fmt: skip
_TAKES = "int (const double *inputs, size_t n_inputs, double *outputs, size_t n_outputs, void *user_data)"
_FORM = "int(double*,size_t,double*,size_t,void*)"  # of a capsule, without blanks
_CFuncPtr: Any = C_TYPE.__mro__[1]


def address_of(function: Any) -> tuple[int, int] | None:
    """Give the addresses of a compiled function and of data that it brings; None for anything else."""
    if isinstance(function, bool):
        return None
    data = 0
    if isinstance(function, int | np.integer):
        address = int(function)
    elif isinstance(function, _CFuncPtr):
        address = _of_ctypes(function, function)
    elif isinstance(getattr(function, "address", None), int) and hasattr(function, "ctypes"):  # numba.cfunc
        address = _of_ctypes(function, function.ctypes)
    elif isinstance(function, tuple) and hasattr(function, "signature"):  # scipy.LowLevelCallable
        address, data = _of_capsule(function)
    else:
        return None
    if not 0 < address < 2 ** (8 * ctypes.sizeof(ctypes.c_void_p)):
        raise ParameterError.of("function", function, "the address of a function, not null")
    return address, data


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


def _of_capsule(function: Any) -> tuple[int, int]:
    signature = str(function.signature)
    form = "".join(signature.split()).replace("const", "")
    for size in ("unsignedlonglong", "unsignedlong", "ulonglong", "ulong", "uintptr_t", "uint64_t"):
        form = form.replace(size, "size_t")
    if form != _FORM:
        raise ParameterError(f"function: its signature is {signature}: must be {_TAKES}")
    capsule = tuple.__getitem__(function, 0)
    pointer, context = ctypes.pythonapi.PyCapsule_GetPointer, ctypes.pythonapi.PyCapsule_GetContext
    pointer.restype = context.restype = ctypes.c_void_p
    pointer.argtypes, context.argtypes = [ctypes.py_object, ctypes.c_char_p], [ctypes.py_object]
    return pointer(capsule, signature.encode()) or 0, context(capsule) or 0
