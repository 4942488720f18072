"""
The C++ core of mgdd, a submodule per room. Use it through mgdd.engine, mgdd.throttle and so on.
"""
from __future__ import annotations
from . import math
from . import optimize
from . import control
from . import engine
from . import throttle
from . import identify
from . import guide
from . import loop
from . import rig
__all__: list[str] = ['compiled_simd_level', 'compiler', 'control', 'engine', 'guide', 'identify', 'instruction_set', 'loop', 'math', 'optimize', 'processor_simd_levels', 'rig', 'throttle']
def compiled_simd_level() -> str:
    """
    Instruction set of this build.
    """
def compiler() -> str:
    """
    Compiler of this build.
    """
def instruction_set() -> str:
    """
    Instruction set that the kernels run in: the widest of this processor, or MGDD_INSTRUCTION_SET.
    """
def processor_simd_levels() -> list[str]:
    """
    Vector instruction sets of this processor.
    """
__version__: str = '0.1.0'
