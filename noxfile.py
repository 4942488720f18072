#!/usr/bin/env -S uv run --script
# /// script
# dependencies = ["nox>=2025.2.9"]
# ///
"""Sessions of nox over the commands of the Makefile, which make an environment themselves: `nox -s tests`."""

import nox

nox.needs_version = ">=2025.2.9"
nox.options.default_venv_backend = "none"


@nox.session(default=True)
def tests(session: nox.Session) -> None:
    """Run the tests of both languages, but studies and those marked slow."""
    session.run("make", "test", *session.posargs, external=True)


@nox.session(default=True)
def lint(session: nox.Session) -> None:
    """Run the linters, the type checker and the check of formats."""
    session.run("make", "lint", *session.posargs, external=True)


@nox.session(default=False)
def docs(session: nox.Session) -> None:
    """Build the documentation."""
    session.run("make", "docs", *session.posargs, external=True)


@nox.session(default=False)
def wheel(session: nox.Session) -> None:
    """Install the package as a user does, and try it."""
    session.run("make", "wheel-check", *session.posargs, external=True)


if __name__ == "__main__":
    nox.main()
