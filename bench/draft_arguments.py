"""Arguments of a draft that answer questions on columns and rows, in the interface's words."""

from __future__ import annotations

from dogshape.sim.interface import argument, key_argument, listed_argument, text_value

NONE = "-"  #: column of a quantity that is not to be read


def column_argument(quantity: str, column: str) -> str:
    """Write the column of a quantity: a head, a head with a unit, or a formula."""
    return key_argument("columns", quantity, column, quoted=True)


def column_placeholder(quantity: str, placeholder: str = "COLUMN") -> str:
    """Write the column of a quantity as a word to replace, or a number for all rows."""
    return key_argument("columns", quantity, placeholder)


def no_column(quantity: str) -> str:
    """Write that a quantity has no column."""
    return key_argument("columns", quantity, NONE)


def drop_argument(column: str, value: str) -> str:
    """Write the rows of a value as no shifts."""
    return listed_argument("drop", f"{column}={value}", quoted=True)


def keep_argument(column: str, value: str) -> str:
    """Write the argument ``keep``, which keeps only rows with a value in a column."""
    return listed_argument("keep", f"{column}={value}", quoted=True)


def rows_argument(rows: str) -> str:
    """Write the rows of the file that are shifts, ``2-41,45``."""
    return argument("rows", rows or "ROWS")


def rows_example(rows: str) -> str:
    """Name the argument of the rows that are shifts, with an example."""
    return f"{argument('rows')}, such as {text_value(rows)}"
