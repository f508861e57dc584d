"""What a mutation does to its statement: operations on its syntax, which need none of its identifiers.

Each takes the statement, a place in it (`at`, see syntax.py; default its value) and options:

    drop                            the statement becomes `pass`
    swap_with_next                  the statement and the next one change places
    negate                          x -> -x
    zero                            x -> x - x, zero of whatever type
    scale         factor            x -> factor x, in the type of x (a scalar)
    constant      from, to          a number becomes another; `occurrence` where it stands more than once
    operator      from, to          likewise an operator; with "=" ("+=") that of an augmented assignment
    condition     value             the condition becomes true or false
    keep_left, keep_right           a binary operation becomes one of its operands
    keep_argument argument          a call becomes its argument, counted from 1
    drop_argument argument          a call without that argument
    swap_arguments                  the two arguments of a call change places
    own_index                       a[i] = b[j] -> a[i] = b[i]
    replace       new               new text, the last resort

In `new`, `{PLACE}` is a part of what is replaced, `{}` all of it, and `{MARKER: PLACE}` a part of another
marked statement. All names must come from there, except Python's own (`type`, `min`, ...): `type({})(0.5)` is
0.5 in the type of what is replaced.
"""

from __future__ import annotations

import ast
import copy
import dataclasses
import re
from collections.abc import Callable
from typing import Any

from comparisons.mutation import syntax
from comparisons.mutation.markers import Marked
from comparisons.mutation.syntax import Slot
from gpudem.errors import GpudemError

PLACEHOLDER = re.compile(r"\{(?:\s*([a-z][a-z0-9_]*)\s*:)?([^{}:]*)\}")
#: The names that `new` may use beside those of placeholders.
ALLOWED_NAMES = frozenset({"type", "int", "len", "min", "max", "all", "any"})


@dataclasses.dataclass(frozen=True)
class Operation:
    """One operation with its options."""

    kind: str
    at: str = ""
    options: dict[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.kind not in STATEMENTS and self.kind not in EXPRESSIONS:
            raise GpudemError(f"unknown operation {self.kind!r}")
        required, optional = OPTIONS.get(self.kind, ((), ()))
        missing = set(required) - set(self.options)
        unknown = set(self.options) - set(required) - set(optional)
        if missing or unknown:
            raise GpudemError(
                f"operation {self.kind!r}: missing {sorted(missing)}, unknown {sorted(unknown)}"
            )

    def __str__(self) -> str:
        options = [f"{key} {value}" for key, value in self.options.items()]
        return ", ".join([self.kind.replace("_", " "), *([f"at {self.at}"] if self.at else []), *options])

    def applied(self, marked: Marked, find: Callable[[str], Marked]) -> str:
        """The text of the file with the marked statement changed. GpudemError if that cannot be done."""
        if self.kind in STATEMENTS:
            text = STATEMENTS[self.kind](marked)
        else:
            text = self._expression_applied(marked, find)
        try:
            ast.parse(text)
        except SyntaxError as error:
            raise GpudemError(f"the result is not valid Python: {error}") from None
        return text

    def _expression_applied(self, marked: Marked, find: Callable[[str], Marked]) -> str:
        statement = copy.deepcopy(marked.statement)
        slot = syntax.resolve(statement, self.at)
        EXPRESSIONS[self.kind](slot, _Context(statement, find), self.options)
        if ast.dump(statement) == ast.dump(marked.statement):
            raise GpudemError("it changes nothing")
        if not hasattr(statement, "body"):
            return marked.replaced(*marked.span(marked.statement), ast.unparse(statement))
        head = syntax.value(statement).field  # of a statement with a block only the head is written anew
        new = ast.unparse(getattr(statement, head))
        return marked.replaced(*marked.span(getattr(marked.statement, head)), new)


@dataclasses.dataclass
class _Context:
    statement: ast.stmt
    find: Callable[[str], Marked]


# -- on whole statements -------------------------------------------------------------------------------------


def _drop(marked: Marked) -> str:
    if marked.source(marked.statement).startswith("elif"):
        raise GpudemError("an 'elif' cannot be dropped: its condition can be false")
    if isinstance(marked.statement, ast.Pass):
        raise GpudemError("it changes nothing")
    return marked.replaced(*marked.span(marked.statement), "pass")


def _swap_with_next(marked: Marked) -> str:
    after = marked.next_statement()
    if after is None:
        raise GpudemError("no statement follows in the same block")
    if ast.dump(after) == ast.dump(marked.statement):
        raise GpudemError("it changes nothing")
    (begin, end), (begin_after, end_after) = marked.span(marked.statement), marked.span(after)
    between = marked.text.encode()[end:begin_after].decode()
    swapped = marked.source(after) + between + marked.source(marked.statement)
    return marked.replaced(begin, end_after, swapped)


# -- on expressions ------------------------------------------------------------------------------------------


def _negate(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    slot.node = ast.UnaryOp(ast.USub(), slot.node)


def _zero(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    slot.node = ast.BinOp(slot.node, ast.Sub(), copy.deepcopy(slot.node))


def _scale(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    kind = ast.Call(ast.Name("type"), [copy.deepcopy(slot.node)], [])
    factor = ast.Call(kind, [ast.Constant(options["factor"])], [])
    slot.node = ast.BinOp(factor, ast.Mult(), slot.node)


def _constant(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    def is_it(node: ast.Constant) -> bool:
        number = isinstance(node.value, int | float) and not isinstance(node.value, bool)
        return number and node.value == options["from"]

    at_place = [slot] if isinstance(slot.node, ast.Constant) else []
    found = [s for s in [*at_place, *syntax.in_order(slot.node, ast.Constant)] if is_it(s.node)]
    _chosen(found, f"number {options['from']}", options).node = ast.Constant(options["to"])


def _operator(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    old, new = options["from"], options["to"]
    if old.endswith("=") and old.removesuffix("=") in ("+", "-", "*", "/"):
        statement = context.statement
        kind = syntax.OPERATORS[old.removesuffix("=")]
        if not isinstance(statement, ast.AugAssign) or not isinstance(statement.op, kind):
            raise GpudemError(f"the statement has no operator {old!r}")
        statement.op = _operator_node(new.removesuffix("="))
        return
    node = _chosen(syntax.operators(slot, old), f"operator {old!r}", options).node
    operator = _operator_node(new)
    if isinstance(node, ast.Compare) and isinstance(operator, ast.cmpop):
        node.ops = [operator]
    elif (isinstance(node, ast.BoolOp) and isinstance(operator, ast.boolop)) or (
        isinstance(node, ast.BinOp) and isinstance(operator, ast.operator)
    ):
        node.op = operator  # type: ignore[assignment]
    else:
        raise GpudemError(f"{new!r} cannot take the place of {old!r}")


def _operator_node(symbol: str) -> Any:
    if symbol not in syntax.OPERATORS:
        raise GpudemError(f"unknown operator {symbol!r}")
    return syntax.OPERATORS[symbol]()


def _chosen(found: list[Slot], what: str, options: dict[str, Any]) -> Slot:
    """The occurrence asked for; without one there has to be exactly one."""
    k = options.get("occurrence")
    if k is None and len(found) != 1:
        raise GpudemError(f"the {what} occurs {len(found)} times; once was expected")
    if k is not None and not 1 <= k <= len(found):
        raise GpudemError(f"the {what} occurs {len(found)} times; there is no occurrence {k}")
    return found[0 if k is None else k - 1]


def _condition(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    if slot.field != "test":
        raise GpudemError("the statement has no condition")
    slot.node = ast.Constant(options["value"])


def _keep(side: int) -> Callable[[Slot, _Context, dict[str, Any]], None]:
    def keep(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
        found = syntax.operand(slot, side)
        if found is None:
            raise GpudemError(f"'{ast.unparse(slot.node)}' has no operands")
        slot.node = found.node

    return keep


def _keep_argument(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    slot.node = _argument(slot, options).node


def _drop_argument(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    call, place = slot.node, _argument(slot, options)
    if isinstance(place.owner, ast.keyword):
        call.keywords.remove(place.owner)
    else:
        assert place.item is not None
        del call.args[place.item]


def _argument(slot: Slot, options: dict[str, Any]) -> Slot:
    places, k = syntax.arguments(slot.node), options["argument"]
    if not 1 <= k <= len(places):
        raise GpudemError(f"'{ast.unparse(slot.node)}' has no argument {k}")
    return places[k - 1]


def _swap_arguments(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    places = syntax.arguments(slot.node)
    if len(places) != 2:
        raise GpudemError(f"'{ast.unparse(slot.node)}' has {len(places)} arguments; two were expected")
    places[0].node, places[1].node = places[1].node, places[0].node


def _own_index(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    target = syntax.resolve(context.statement, "target").node
    if not isinstance(target, ast.Subscript) or not isinstance(slot.node, ast.Subscript):
        raise GpudemError("the statement is not of the form a[i] = b[j]")
    slot.node.slice = copy.deepcopy(target.slice)


def _replace(slot: Slot, context: _Context, options: dict[str, Any]) -> None:
    def part(match: re.Match[str]) -> str:
        marker, place = match.groups()
        if marker is None:
            found = syntax.resolve(context.statement, place, slot)
        else:
            found = syntax.resolve(copy.deepcopy(context.find(marker).statement), place)
        return f"({ast.unparse(found.node)})"

    new = PLACEHOLDER.sub(part, options["new"])
    try:
        if slot.field == "slice":
            slot.node = ast.parse(f"_[{new}]", mode="eval").body.slice  # type: ignore[attr-defined]
        else:
            slot.node = ast.parse(new, mode="eval").body
    except SyntaxError:
        raise GpudemError(f"{options['new']!r} gives {new!r}, which is no expression") from None


STATEMENTS: dict[str, Callable[[Marked], str]] = {"drop": _drop, "swap_with_next": _swap_with_next}
EXPRESSIONS: dict[str, Callable[[Slot, _Context, dict[str, Any]], None]] = {
    "negate": _negate,
    "zero": _zero,
    "scale": _scale,
    "constant": _constant,
    "operator": _operator,
    "condition": _condition,
    "keep_left": _keep(0),
    "keep_right": _keep(1),
    "keep_argument": _keep_argument,
    "drop_argument": _drop_argument,
    "swap_arguments": _swap_arguments,
    "own_index": _own_index,
    "replace": _replace,
}
#: Required and optional options of the operations that have any.
OPTIONS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "scale": (("factor",), ()),
    "constant": (("from", "to"), ("occurrence",)),
    "operator": (("from", "to"), ("occurrence",)),
    "condition": (("value",), ()),
    "keep_argument": (("argument",), ()),
    "drop_argument": (("argument",), ()),
    "replace": (("new",), ()),
}
