// The error tree: every exception of the core, mapped one to one to `mgdd.errors` in Python.
// Messages name the field, the value and the bound or the remedy. Not for real-time paths: those return status codes.
#pragma once

#include <stdexcept>
#include <string>

namespace mgdd {

/// Base of everything the core throws.
struct Error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A parameter outside its domain, for example `bore_mm = -86.0: must be > 0`.
struct ParameterError : Error {
  using Error::Error;
};

/// An array of the wrong length or dimension.
struct ShapeError : Error {
  using Error::Error;
};

/// Measured data that cannot be what the caller says they are: gaps, NaN, a wrong unit.
struct DataError : Error {
  using Error::Error;
};

/// A numerical method that did not reach its tolerance where no report can carry that news.
struct ConvergenceError : Error {
  using Error::Error;
};

/// A test rig that cannot do what was asked: not connected, asked out of order, no answer.
struct RigError : Error {
  using Error::Error;
};

}  // namespace mgdd
