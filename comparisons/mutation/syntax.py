"""Parts of a marked statement, found by their place in its syntax: no identifier, so no rename matters.

A place is a list of steps from the value of the statement (what is assigned, returned or called; the
condition of `if` and `while`, what a `for` runs over), such as "argument 3, left":

    left, right         of a binary operator, a comparison or `and`/`or` of two
    operand             of a sign or `not`
    argument K          of a call, from 1; keyword arguments count after the others
    function            of a call
    element K           of a tuple or a list, from 1
    object              of a subscript or an attribute: a of a[i] and a.b
    index               of a subscript: i of a[i]
    call K              the K-th call in the order of the text
    operator OP [K]     the K-th binary operator OP; without K the only one
    target              first step only: what the statement assigns to
    name                last step of a placeholder only: the name itself, as a string
"""

from __future__ import annotations

import ast
import dataclasses
from typing import Any

from gpudem.errors import GpudemError

#: Binary operators, comparisons and boolean operators by their symbols.
OPERATORS: dict[str, type[ast.AST]] = {
    "+": ast.Add, "-": ast.Sub, "*": ast.Mult, "/": ast.Div, "//": ast.FloorDiv, "%": ast.Mod, "**": ast.Pow,
    "&": ast.BitAnd, "|": ast.BitOr, "^": ast.BitXor, "<<": ast.LShift, ">>": ast.RShift,
    "<": ast.Lt, "<=": ast.LtE, ">": ast.Gt, ">=": ast.GtE, "==": ast.Eq, "!=": ast.NotEq,
    "is": ast.Is, "is not": ast.IsNot, "in": ast.In, "not in": ast.NotIn, "and": ast.And, "or": ast.Or,
}  # fmt: skip


@dataclasses.dataclass
class Slot:
    """A place in a syntax tree that holds a node: a field of its owner, or an item of a list there."""

    owner: Any
    field: str
    item: int | None = None

    @property
    def node(self) -> Any:
        """The node that stands there."""
        value = getattr(self.owner, self.field)
        return value if self.item is None else value[self.item]

    @node.setter
    def node(self, new: Any) -> None:
        if self.item is None:
            setattr(self.owner, self.field, new)
        else:
            getattr(self.owner, self.field)[self.item] = new


def value(statement: ast.stmt) -> Slot:
    """The place where a statement holds its value. Raises GpudemError for one without."""
    fields = ("test", "iter", "value")
    for field in fields:
        if getattr(statement, field, None) is not None:
            return Slot(statement, field)
    raise GpudemError(f"a statement '{type(statement).__name__}' has no value")


def resolve(statement: ast.stmt, place: str, start: Slot | None = None) -> Slot:
    """The place in a statement, from its value or from `start`. Raises GpudemError if it is not there."""
    steps = [step.split() for step in place.split(",") if step.strip()]
    if steps and steps[0] == ["target"]:
        slot = _target(statement)
        steps = steps[1:]
    else:
        slot = start or value(statement)
    for step in steps:
        found = _step(slot, step[0], step[1:])
        if found is None:
            raise GpudemError(f"there is no {' '.join(step)!r} in '{ast.unparse(slot.node)}'")
        slot = found
    return slot


def in_order(root: ast.AST, kind: type | tuple[type, ...]) -> list[Slot]:
    """All nodes of a kind below a node, in the order of the text."""
    found = []
    for owner in ast.walk(root):
        for field, held in ast.iter_fields(owner):
            items = [(k, node) for k, node in enumerate(held)] if isinstance(held, list) else [(None, held)]
            found += [Slot(owner, field, k) for k, node in items if isinstance(node, kind)]
    return sorted(found, key=lambda slot: (slot.node.lineno, slot.node.col_offset))


def operators(slot: Slot, symbol: str) -> list[Slot]:
    """The nodes with the operator `symbol` at or below a place, in the order in which operators stand."""
    if symbol not in OPERATORS:
        raise GpudemError(f"unknown operator {symbol!r}")
    kind = OPERATORS[symbol]

    def operator_of(node: ast.AST) -> Any:
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            return node.ops[0]
        return getattr(node, "op", None) if isinstance(node, ast.BinOp | ast.BoolOp) else None

    def position(found: Slot) -> tuple[int, int]:
        left = operand(found, 0)
        assert left is not None
        return left.node.end_lineno, left.node.end_col_offset

    inside = in_order(slot.node, (ast.BinOp, ast.BoolOp, ast.Compare))
    return sorted((s for s in [slot, *inside] if isinstance(operator_of(s.node), kind)), key=position)


def operand(slot: Slot, side: int) -> Slot | None:
    """Left (0) or right (1) operand of a binary operator, a comparison, or `and`/`or` of two."""
    node = slot.node
    if isinstance(node, ast.BinOp):
        return Slot(node, ("left", "right")[side])
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        return Slot(node, "comparators", 0) if side else Slot(node, "left")
    if isinstance(node, ast.BoolOp) and len(node.values) == 2:
        return Slot(node, "values", side)
    return None


def arguments(node: ast.AST) -> list[Slot]:
    """The arguments of a call, those by keyword last; empty for what is no call."""
    if not isinstance(node, ast.Call):
        return []
    places = [Slot(node, "args", k) for k in range(len(node.args))]
    return places + [Slot(keyword, "value") for keyword in node.keywords]


def _target(statement: ast.stmt) -> Slot:
    if isinstance(statement, ast.Assign) and len(statement.targets) == 1:
        return Slot(statement, "targets", 0)
    if isinstance(statement, ast.AugAssign | ast.AnnAssign | ast.For):
        return Slot(statement, "target")
    raise GpudemError(f"'{ast.unparse(statement).splitlines()[0]}' assigns to no single target")


def _step(slot: Slot, word: str, options: list[str]) -> Slot | None:
    node = slot.node
    plain = {
        "left": lambda: operand(slot, 0),
        "right": lambda: operand(slot, 1),
        "operand": lambda: Slot(node, "operand") if isinstance(node, ast.UnaryOp) else None,
        "function": lambda: Slot(node, "func") if isinstance(node, ast.Call) else None,
        "object": lambda: Slot(node, "value") if isinstance(node, ast.Subscript | ast.Attribute) else None,
        "index": lambda: Slot(node, "slice") if isinstance(node, ast.Subscript) else None,
        "name": lambda: _name(node),
    }
    if word in plain and not options:
        return plain[word]()
    if word == "operator" and options:
        found = operators(slot, options[0])
        if options[1:]:
            return _item(found, options[1:])
        return found[0] if len(found) == 1 else None
    if word in ("argument", "element", "call"):
        elements = [Slot(node, "elts", k) for k in range(len(getattr(node, "elts", [])))]
        places = {"argument": arguments(node), "element": elements, "call": in_order(node, ast.Call)}
        if word == "call" and isinstance(node, ast.Call):
            places["call"].insert(0, slot)
        return _item(places[word], options)
    raise GpudemError(f"unknown step {' '.join([word, *options])!r}")


def _item(slots: list[Slot], options: list[str]) -> Slot | None:
    if len(options) != 1 or not options[0].isdecimal():
        raise GpudemError(f"a step needs one number from 1, not {' '.join(options)!r}")
    k = int(options[0])
    return slots[k - 1] if 1 <= k <= len(slots) else None


def _name(node: ast.AST) -> Slot | None:
    text = getattr(node, "id", None) or getattr(node, "attr", None)
    return Slot(ast.Expression(ast.Constant(text)), "body") if isinstance(text, str) else None
