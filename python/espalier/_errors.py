"""Exceptions: each is an Error and the built-in exception that callers expect."""

from . import _core

class Error(RuntimeError):
    """What the solver reports. `row`, `column`: of the caller's matrix, from 0; None when none is concerned."""

    row: "int | None" = None
    column: "int | None" = None


class InvalidInputError(Error, ValueError):
    """The matrix or an option is not usable."""


class SingularMatrixError(Error, ArithmeticError):
    """The matrix is singular, structurally or to rounding."""


class NotPositiveDefiniteError(Error, ArithmeticError):
    """kind="llt" met a pivot that is not positive."""


class OutOfMemoryError(Error, MemoryError):
    """The budget or the machine's memory is too small."""


class DeviceError(Error):
    """A device failed or is not there."""


class AccuracyWarning(UserWarning):
    """A solution's backward error is above required_backward_error; it is returned all the same."""


_BY_CODE = {2: InvalidInputError, 3: SingularMatrixError, 4: NotPositiveDefiniteError, 5: OutOfMemoryError,
            6: DeviceError}


def make_error(code: int, message: str, row: int) -> Error:
    error = _BY_CODE.get(code, Error)(message)
    error.row = row if row >= 0 else None
    return error


def transposed_error(code: int, message: str, row: int) -> Error:
    """As make_error, of a solver that was given the transpose: its rows are the caller's columns."""
    error = make_error(code, _core.transposed_text(message), -1)
    error.column = row if row >= 0 else None
    return error
