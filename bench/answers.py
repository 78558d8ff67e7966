"""Answers of a user on the columns and rows of a table, in the words of the interface."""

from __future__ import annotations

from dogshape.sim.interface import argument, key_argument, listed_argument, text_value

NONE = "-"  #: column of a quantity that is not to be read


def column_answer(quantity: str, column: str) -> str:
    """Write the answer that ``column``, a head, a head with a unit or a formula, is a quantity."""
    return key_argument("columns", quantity, column, quoted=True)


def column_placeholder(quantity: str, placeholder: str = "COLUMN") -> str:
    """Write the answer with a word to replace, or with a number for all rows."""
    return key_argument("columns", quantity, placeholder)


def no_column(quantity: str) -> str:
    """Write the answer that no column is a quantity."""
    return key_argument("columns", quantity, NONE)


def drop_rows(column: str, value: str) -> str:
    """Write the answer that rows of this value are no shifts."""
    return listed_argument("drop", f"{column}={value}", quoted=True)


def keep_rows(column: str, value: str) -> str:
    """Write the answer that rows of this value alone are shifts."""
    return listed_argument("keep", f"{column}={value}", quoted=True)


def shift_rows(rows: str) -> str:
    """Write the answer that these rows of the file, ``2-41,45``, are the shifts."""
    return argument("rows", rows or "ROWS")


def rows_example(rows: str) -> str:
    """Write the argument of the rows that are shifts, with an example."""
    return f"{argument('rows')}, such as {text_value(rows)}"
