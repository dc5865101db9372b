"""Machine code for laws that are plain formulas, in milliseconds: nothing has to be inferred of them.

numba takes ten times as long for a function of one line, and a search for a law tries dozens that nobody
has written before. Here each operation of such a law becomes the one instruction, or the call of the
mathematical library, that numba makes of it.
"""

import ast
import inspect
import itertools
from typing import TYPE_CHECKING, Any

from llvmlite import binding, ir
from numba.core.compiler_lock import global_compiler_lock

from impactcell.numerics.jit import Law, place_at

if TYPE_CHECKING:
    from collections.abc import Callable

_NUMBER = ir.DoubleType()
_INDEX = ir.IntType(64)
"""Of a parameter: numba's own, 64 bits."""
_ARGUMENTS = [_NUMBER] * 4 + [_NUMBER.as_pointer()]
"""Of a law, as `Law` has them: four numbers, and where its parameters lie."""
_FUNCTIONS = {"exp": 1, "sin": 1, "cos": 1, "tanh": 1, "log1p": 1, "sqrt": 1, "pow": 2}
"""What a formula may call of `math`, and how many numbers each takes."""
_numbers = itertools.count()


def compile_formula(source: str, law: Law) -> None:
    """Compile a law from its source, so that `jit.address` finds it.

    Parameters
    ----------
    source : str
        Text that defines it: assignments of names and a value that is returned, made of numbers, names,
        elements of the parameters, + - * / and whole powers, `abs`, `max` and functions of `math`.
    law : callable
        The same function.

    Raises
    ------
    ValueError
        There is something else in it.
    """
    name = law.__name__
    (definition,) = (
        node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef) and node.name == name
    )
    symbol = f"formula_{next(_numbers)}"
    module = ir.Module(symbol)
    module.triple = binding.get_process_triple()
    function = ir.Function(module, ir.FunctionType(_NUMBER, _ARGUMENTS), symbol)
    builder = ir.IRBuilder(function.append_basic_block())
    names = dict(zip(inspect.signature(law).parameters, function.args, strict=True))
    _Writer(module, builder, names).write(definition)
    with global_compiler_lock:  # LLVM has one context for all threads
        machine = binding.Target.from_default_triple().create_target_machine(opt=3)
        engine = binding.create_mcjit_compiler(binding.parse_assembly(str(module)), machine)
        engine.finalize_object()
    place_at(law, engine.get_function_address(symbol), engine)


class _Writer:
    """Writes the instructions of one law."""

    def __init__(self, module: ir.Module, builder: ir.IRBuilder, names: dict[str, ir.Value]) -> None:
        self._module = module
        self._builder = builder
        self._names = names
        self._operations: dict[type[ast.operator], Callable[..., Any]] = {
            ast.Add: builder.fadd,
            ast.Sub: builder.fsub,
            ast.Mult: builder.fmul,
            ast.Div: builder.fdiv,
        }

    def write(self, definition: ast.FunctionDef) -> None:
        """Write all statements."""
        for statement in definition.body:
            match statement:
                case ast.Expr(ast.Constant(str())):
                    continue
                case ast.Assign([ast.Name(name)], value):
                    self._names[name] = self._value(value)
                case ast.Return(ast.expr() as value):
                    self._builder.ret(self._value(value))
                case _:
                    raise ValueError(ast.unparse(statement))

    def _value(self, node: ast.expr) -> ir.Value:
        match node:
            case ast.Constant(float() | int() as number):
                return ir.Constant(_NUMBER, float(number))
            case ast.Name(name) if name in self._names:
                return self._names[name]
            case ast.UnaryOp(ast.USub(), operand):
                return self._builder.fneg(self._value(operand))
            case ast.Subscript(ast.Name(name), ast.Constant(int() as place)):
                where = self._builder.gep(self._names[name], [ir.Constant(_INDEX, place)])
                return self._builder.load(where)
            case ast.BinOp(base, ast.Pow(), ast.Constant(int() as exponent)) if exponent in {2, 3}:
                value = self._value(base)
                square = self._builder.fmul(value, value)
                return square if exponent == 2 else self._builder.fmul(square, value)
            case ast.BinOp(left, operation, right) if type(operation) in self._operations:
                return self._operations[type(operation)](self._value(left), self._value(right))
            case ast.Call(ast.Name("abs"), [argument]):
                return self._call("llvm.fabs.f64", [argument])
            case ast.Call(ast.Name("max"), [first, second]):
                one, other = self._value(first), self._value(second)
                return self._builder.select(self._builder.fcmp_ordered(">", other, one), other, one)
            case ast.Call(ast.Attribute(ast.Name("math"), name), arguments):
                if _FUNCTIONS.get(name) == len(arguments):
                    return self._call(name, arguments)
        raise ValueError(ast.unparse(node))

    def _call(self, name: str, arguments: list[ast.expr]) -> ir.Value:
        kind = ir.FunctionType(_NUMBER, [_NUMBER] * len(arguments))
        known = self._module.globals.get(name) or ir.Function(self._module, kind, name)
        return self._builder.call(known, [self._value(argument) for argument in arguments])
