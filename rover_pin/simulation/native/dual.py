"""Translation of the step's C code to dual numbers, so that one source gives the step and its derivatives.

A dual number is a value with its derivatives by several numbers. C cannot overload operators, so this module reads the
C code, infers the type of every expression, and writes each operation on doubles as one on dual numbers (`dual.h`).
Comparisons and branches look at the values only: the derivatives are those of the branch that the drive takes. The
translation knows the part of C that the files of native/ and the generated laws use, and refuses everything else.

Source: forward mode by operator overloading, Griewank and Walther, Evaluating Derivatives (2008), chapter 6.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from rover_pin.base.files.paths import text_of_package

DUAL_SIZE = 8
"""Entries of a dual number: the value and seven derivatives. A vector of eight doubles is one register of the widest
processors."""

TOKEN = re.compile(
    r"""(?P<skip>\s+|/\*.*?\*/|//[^\n]*)
      |(?P<directive>\#[^\n]*)
      |(?P<number>(?:0[xX][0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)[uUlLfF]*)
      |(?P<name>[A-Za-z_]\w*)
      |(?P<string>"[^"]*")
      |(?P<mark>->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||\+=|-=|\*=|/=|[-+*/%&|^~!<>=?:;,.(){}\[\]])""",
    re.VERBOSE | re.DOTALL,
)

Type = Any
"""Type of an expression: DUAL, PASSIVE (a number without derivatives), ROW, ("pointer", type) or ("struct", name)."""
DUAL, PASSIVE, ROW = "dual", "passive", "row"
REALS = {"double", "real", "V"}
"""Names of the C types that become dual numbers."""
QUALIFIERS = {"const", "static", "inline", "restrict", "extern"}
UNTRANSLATED = {"row_where"}
"""Functions of the C code that dual.h defines itself, because they work on the bits of numbers."""
ELEMENTARY = set(
    "sqrt exp expm1 log log1p sin cos tan asin acos atan sinh cosh tanh erf rint fabs fmax fmin copysign remainder "
    "atan2 pow".split()
)
"""Functions of the C library that dual.h defines for dual numbers."""
LEVELS = (("||",), ("&&",), ("|",), ("^",), ("&",), ("==", "!="), ("<", ">", "<=", ">="), ("<<", ">>"), ("+", "-"),
          ("*", "/", "%"))  # fmt: skip
"""Binary operators of C, from the weakest to the strongest binding."""
ROW_OPERATIONS = {"+": "row_add", "-": "row_sub", "*": "row_mul", "/": "row_div", ">": "row_greater", "<": "row_less"}
COMPARISONS = {"==", "!=", "<", ">", "<=", ">=", "&&", "||"}


class Expression(NamedTuple):
    """A translated expression: its C code and its type."""

    code: str
    type: Type


class Function(NamedTuple):
    """What a call of a function needs: the type of the result and those of the parameters."""

    result: Type
    parameters: tuple[Type, ...]


class TranslationError(Exception):
    """The C code contains something that the translation does not know."""


@lru_cache(maxsize=8)
def dual_source(source: str) -> str:
    """Return the C source of the step, translated to dual numbers, with the definitions of dual numbers before it."""
    translation = _Translation()
    return _prelude() + translation.translate(source)


def dual_laws_source(lane_source: str, called_as_scalar: Sequence[tuple[str, int, Sequence[int]]] = ()) -> str:
    """Return the C source of generated laws (`lanes.c_source`), translated to dual numbers.

    Parameters
    ----------
    lane_source : str
        The generated functions, each with one column as its output.
    called_as_scalar : sequence of (name, inputs, sizes)
        Functions that the step calls with arrays of pointers to inputs and results, as CasADi's own code. Each gets a
        wrapper `NAME_scalar`, which passes on the given number of inputs, and divides the column into results of these
        sizes.
    """
    text = _prelude() + _Translation().translate(lane_source)
    for name, inputs, sizes in called_as_scalar:
        parts = "".join(
            f"memcpy(out[{k}], column + {sum(sizes[:k])}, {size} * sizeof(Dual)); "
            for k, size in enumerate(sizes)
            if size
        )
        arguments = ", ".join([*(f"in[{k}]" for k in range(inputs)), "column"])
        text += (
            f"int {name}_scalar(const Dual **in, Dual **out, integer *iw, Dual *w, int memory) {{ "
            f"Dual column[{max(1, sum(sizes))}]; {name}({arguments}); {parts}return 0; }}\n"
        )
    return text


def _prelude() -> str:
    """Return the C code that defines dual numbers."""
    return f"#define DUAL_SIZE {DUAL_SIZE}\n" + text_of_package("rover_pin.simulation.native", "dual.h")


class _Translation:
    """One pass over a C source: a recursive-descent parser that writes the translated code as it reads."""

    def __init__(self) -> None:
        self.macros: dict[str, list[str]] = {}
        self.structs: dict[str, dict[str, Type]] = {}
        self.typedefs: dict[str, Type] = {name: DUAL for name in REALS} | {"Row": ROW}
        self.typedefs |= dict.fromkeys(["int", "integer", "int64_t", "size_t", "void", "Cells", "char"], PASSIVE)
        self.callable_types: dict[str, Function] = {}
        self.functions: dict[str, Function] = {}
        self.scopes: list[dict[str, Type]] = [{}]
        self.result: Type = PASSIVE
        self.compares_values = False
        self.tokens: list[str] = []
        self.at = 0

    # Tokens.

    def translate(self, source: str) -> str:
        self.tokens, self.at = self._tokens(source), 0
        out = []
        while self.at < len(self.tokens):
            out.append(self._definition())
        return "\n".join(out) + "\n"

    def _tokens(self, source: str) -> list[str]:
        """Split the source into tokens. Macros without parameters are replaced by their tokens; comments and the other
        directives are dropped.
        """
        tokens: list[str] = []
        place = 0
        while place < len(source):
            match = TOKEN.match(source, place)
            if match is None:
                raise TranslationError(f"unknown token: {source[place : place + 40]!r}")
            place = match.end()
            text = match.group()
            if match.lastgroup == "directive":
                self._directive(text)
            elif match.lastgroup == "name" and text in self.macros:
                tokens += self.macros[text]
            elif match.lastgroup != "skip":
                tokens.append(text)
        return tokens

    def _directive(self, text: str) -> None:
        words = text.split(None, 2)
        if words[0] == "#define":
            self.macros[words[1]] = self._tokens(words[2] if len(words) > 2 else "")
        elif words[0] == "#undef":
            del self.macros[words[1]]
        elif words[0] not in ("#include", "#line"):
            raise TranslationError(f"unknown directive: {text}")

    def _peek(self, ahead: int = 0) -> str:
        return self.tokens[self.at + ahead] if self.at + ahead < len(self.tokens) else ""

    def _next(self) -> str:
        self.at += 1
        return self.tokens[self.at - 1]

    def _take(self, token: str) -> bool:
        """Read the token if it is the next one, and return whether it was."""
        if self._peek() != token:
            return False
        self.at += 1
        return True

    def _expect(self, token: str) -> None:
        if not self._take(token):
            raise TranslationError(f"expected {token}: {' '.join(self.tokens[max(0, self.at - 20) : self.at + 10])}")

    def _skip_group(self) -> str:
        """Read a group in brackets, which begins here, without translating it."""
        pairs = {"(": ")", "{": "}", "[": "]"}
        begin, depth = self.at, 0
        while True:
            token = self._next()
            depth += (token in pairs) - (token in pairs.values())
            if depth == 0:
                return " ".join(self.tokens[begin : self.at])

    # Types and declarations.

    def _starts_type(self, ahead: int = 0) -> bool:
        word = self._peek(ahead)
        return word in self.typedefs or word in QUALIFIERS or word in ("struct", "_Alignas")

    def _base_type(self) -> Expression:
        """Read the specifiers of a declaration, such as `static const double`."""
        words: list[str] = []
        kind: Type = PASSIVE
        while True:
            if self._peek() in QUALIFIERS:
                words.append(self._next())
            elif self._take("_Alignas"):
                self._skip_group()
            elif self._take("struct"):
                name = self._next()
                words += ["struct", name]
                kind = ("struct", name)
            elif self._peek() in self.typedefs and not (words and words[-1] not in QUALIFIERS):
                word = self._next()
                kind = self.typedefs[word]
                words.append("Dual" if kind == DUAL else word)
            else:
                return Expression(" ".join(words), kind)

    def _declarator(self, base: Type) -> tuple[str, str, Type]:
        """Read a declarator: return the code before the name with the name, the code of the dimensions, and the type
        of the name.
        """
        stars = ""
        while self._peek() in ("*", "const", "restrict"):
            token = self._next()
            stars += token + ("" if token == "*" else " ")
            base = ("pointer", base) if token == "*" else base
        name = self._next() if re.match(r"[A-Za-z_]", self._peek()) else ""
        dimensions, count = "", 0
        while self._take("["):
            size = "" if self._peek() == "]" else self._expression().code
            self._expect("]")
            dimensions, count = f"{dimensions}[{size}]", count + 1
        for _ in range(count):
            base = ("pointer", base)
        return f"{stars}{name}", dimensions, base

    def _definition(self) -> str:
        """Translate one definition outside of functions."""
        if self._take("_Static_assert"):
            self._skip_group()
            self._expect(";")
            return ""
        if self._peek() == "typedef":
            return self._typedef()
        if self._take("enum"):
            group = self._skip_group()
            self._expect(";")
            return f"enum {group};"
        begin = self.at
        base = self._base_type()
        code, dimensions, kind = self._declarator(base.type)
        if self._peek() == "(":
            return self._function(base.code, code, kind)
        # A table of constants stays a table of plain numbers.
        if kind == ("pointer", DUAL) and "const" in base.code:
            self._expect("=")
            group = self._skip_group()
            self._expect(";")
            self.scopes[0][code] = ("pointer", PASSIVE)
            return f"{base.code.replace('Dual', 'double')} {code}{dimensions} = {group};"
        self.at = begin
        return self._declaration()

    def _typedef(self) -> str:
        self._expect("typedef")
        if self._peek() == "struct":
            return self._struct()
        if self._peek() in ("int64_t", "double"):  # integer, real and vector types: dual.h defines them
            while not self._take(";"):
                self.at += 1
            return ""
        # A pointer to a function: result (*name)(parameters).
        base = self._base_type()
        self._expect("(")
        self._expect("*")
        name = self._next()
        self._expect(")")
        code, kinds = self._parameters({})
        self._expect(";")
        self.callable_types[name], self.typedefs[name] = Function(base.type, kinds), ("callable", name)
        return f"typedef {base.code} (*{name}){code};"

    def _struct(self) -> str:
        self._expect("struct")
        tag = self._next() if self._peek() != "{" else ""
        self._expect("{")
        fields: dict[str, Type] = {}
        lines = []
        while not self._take("}"):
            base = self._base_type()
            while True:
                code, dimensions, kind = self._declarator(base.type)
                fields[code.lstrip("*")] = kind
                lines.append(f"  {base.code} {code}{dimensions};")
                if not self._take(","):
                    break
            self._expect(";")
        name = self._next()
        self._expect(";")
        self.structs[name], self.typedefs[name] = fields, ("struct", name)
        return "\n".join([f"typedef struct {tag} {{", *lines, f"}} {name};"])

    def _parameters(self, scope: dict[str, Type]) -> tuple[str, tuple[Type, ...]]:
        """Read the parameters of a function, add them to the scope, and return their code and types."""
        self._expect("(")
        codes, kinds = [], []
        while not self._take(")"):
            base = self._base_type()
            code, dimensions, kind = self._declarator(base.type)
            scope[code.lstrip("*").replace("restrict ", "").replace("const ", "")] = kind
            codes.append(f"{base.code} {code}{dimensions}")
            kinds.append(kind)
            self._take(",")
        return f"({', '.join(codes)})", tuple(kinds)

    def _function(self, base: str, name_code: str, kind: Type) -> str:
        name = name_code.lstrip("*")
        scope: dict[str, Type] = {}
        code, kinds = self._parameters(scope)
        self.functions[name] = Function(kind, kinds)
        if self._take(";"):
            return f"{base} {name_code}{code};"
        if name in UNTRANSLATED:
            self._skip_group()
            return ""
        self.scopes.append(scope)
        self.result = kind
        body = self._block()
        self.scopes.pop()
        return f"{base} {name_code}{code} {body}"

    def _declaration(self) -> str:
        """Translate the declaration of variables, up to its semicolon."""
        base, parts = self._base_type(), []
        while True:
            code, dimensions, kind = self._declarator(base.type)
            self.scopes[-1][code.lstrip("*").replace("restrict ", "")] = kind
            value = f" = {self._initial(kind)}" if self._take("=") else ""
            parts.append(f"{code}{dimensions}{value}")
            if not self._take(","):
                break
        self._expect(";")
        return f"{base.code} {', '.join(parts)};"

    def _initial(self, kind: Type) -> str:
        """Translate the initial value of a variable of this type: an expression, or a list in braces."""
        if self._peek() != "{":
            return self._as(self._assignment(), kind)
        if kind == ROW:
            self._skip_group()
            return "row_of(dual(0.0))"
        self._expect("{")
        # Entries of an array have one type; those of a struct have the types of its fields in their order.
        fields = list(self.structs[kind[1]].items()) if kind[0] == "struct" else []
        values, place = [], 0
        while not self._take("}"):
            target = ""
            if self._take("."):
                name = self._next()
                target, place = f".{name} = ", [field for field, _ in fields].index(name)
                self._expect("=")
            elif self._take("["):
                target = f"[{self._expression().code}] = "
                self._expect("]")
                self._expect("=")
            values.append(target + self._initial(fields[place][1] if fields else kind[1]))
            place += 1
            self._take(",")
        return f"{{{', '.join(values)}}}"

    # Statements.

    def _block(self) -> str:
        self._expect("{")
        self.scopes.append({})
        lines = []
        while not self._take("}"):
            lines.append(self._statement())
        self.scopes.pop()
        return "\n".join(["{", *lines, "}"])

    def _statement(self) -> str:
        word = self._peek()
        if word == "{":
            return self._block()
        if self._take(";"):
            return ";"
        if word in ("if", "while"):
            self._next()
            self._expect("(")
            condition = self._truth(self._expression())
            self._expect(")")
            code = f"{word} ({condition}) {self._statement()}"
            return f"{code} else {self._statement()}" if word == "if" and self._take("else") else code
        if self._take("for"):
            return self._for()
        if self._take("return"):
            code = "return;" if self._peek() == ";" else f"return {self._as(self._expression(), self.result)};"
            self._expect(";")
            return code
        if word in ("continue", "break"):
            self._next()
            self._expect(";")
            return f"{word};"
        if self._starts_type():
            return self._declaration()
        code = self._expression().code
        self._expect(";")
        return f"{code};"

    def _for(self) -> str:
        self._expect("(")
        self.scopes.append({})
        if self._starts_type():
            begin = self._declaration()
        else:
            begin = ("" if self._peek() == ";" else self._expression().code) + ";"
            self._expect(";")
        condition = "" if self._peek() == ";" else self._truth(self._expression())
        self._expect(";")
        step = "" if self._peek() == ")" else self._expression().code
        self._expect(")")
        code = f"for ({begin} {condition}; {step}) {self._statement()}"
        self.scopes.pop()
        return code

    # Expressions.

    def _as(self, expression: Expression, kind: Type) -> str:
        """Return the code of an expression where a value of the type `kind` is needed."""
        if kind == DUAL and expression.type == PASSIVE:
            return f"dual({expression.code})"
        if kind == PASSIVE and expression.type == DUAL:
            return f"({expression.code})[0]"
        if kind == ROW and expression.type != ROW:
            return f"row_of({self._as(expression, DUAL)})"
        return expression.code

    def _truth(self, expression: Expression) -> str:
        return self._as(expression, PASSIVE)

    def _expression(self) -> Expression:
        first = self._assignment()
        while self._take(","):
            second = self._assignment()
            first = Expression(f"{first.code}, {second.code}", second.type)
        return first

    def _assignment(self) -> Expression:
        target = self._ternary()
        operator = self._peek()
        if operator == "=":
            self._next()
            return Expression(f"{target.code} = {self._as(self._assignment(), target.type)}", target.type)
        if operator not in ("+=", "-=", "*=", "/="):
            return target
        self._next()
        value = self._assignment()
        if target.type not in (DUAL, ROW):
            return Expression(f"{target.code} {operator} {self._as(value, PASSIVE)}", target.type)
        # The target is evaluated twice, so that it must not change anything.
        if "++" in target.code or "--" in target.code:
            raise TranslationError(f"target with side effects: {target.code}")
        result = self._binary_code(operator[0], target, value)
        return Expression(f"{target.code} = {self._as(result, target.type)}", target.type)

    def _ternary(self) -> Expression:
        condition = self._binary(0)
        if not self._take("?"):
            return condition
        yes = self._expression()
        self._expect(":")
        no = self._ternary()
        kind = DUAL if DUAL in (yes.type, no.type) else yes.type
        return Expression(f"({self._truth(condition)} ? {self._as(yes, kind)} : {self._as(no, kind)})", kind)

    def _binary(self, level: int) -> Expression:
        if level == len(LEVELS):
            return self._unary()
        left = self._binary(level + 1)
        while self._peek() in LEVELS[level]:
            operator = self._next()
            left = self._binary_code(operator, left, self._binary(level + 1))
        return left

    def _binary_code(self, operator: str, a: Expression, b: Expression) -> Expression:
        """Translate an operation of two expressions by their types."""
        kinds = {a.type, b.type} if not isinstance(a.type, tuple) and not isinstance(b.type, tuple) else set()
        if ROW in kinds:
            if operator == "*" and kinds != {ROW}:
                row, factor = (a, b) if a.type == ROW else (b, a)
                return Expression(f"row_scale({row.code}, {self._as(factor, DUAL)})", ROW)
            code = f"{ROW_OPERATIONS[operator]}({self._as(a, ROW)}, {self._as(b, ROW)})"
            return Expression(code, PASSIVE if operator in "<>" else ROW)
        if DUAL not in kinds:
            # Pointers and plain numbers. A pointer plus a number stays a pointer; a difference of pointers is a number.
            kind = a.type if isinstance(a.type, tuple) else b.type
            if operator in COMPARISONS or (isinstance(a.type, tuple) and isinstance(b.type, tuple)):
                kind = PASSIVE
            return Expression(f"({a.code} {operator} {b.code})", kind)
        if operator in ("==", "!=") and not self.compares_values:
            same = f"dual_same({self._as(a, DUAL)}, {self._as(b, DUAL)})"
            return Expression(same if operator == "==" else f"(!{same})", PASSIVE)
        if operator in COMPARISONS:
            return Expression(f"({self._as(a, PASSIVE)} {operator} {self._as(b, PASSIVE)})", PASSIVE)
        if operator in "+-":
            return Expression(f"({self._as(a, DUAL)} {operator} {self._as(b, DUAL)})", DUAL)
        # A plain factor scales value and derivatives alike.
        if b.type == PASSIVE:
            return Expression(f"({a.code} {operator} (double)({b.code}))", DUAL)
        if a.type == PASSIVE and operator == "*":
            return Expression(f"((double)({a.code}) * {b.code})", DUAL)
        name = {"*": "dual_mul", "/": "dual_div"}[operator]
        return Expression(f"{name}({self._as(a, DUAL)}, {b.code})", DUAL)

    def _unary(self) -> Expression:
        token = self._peek()
        if token in ("-", "+", "~"):
            self._next()
            operand = self._unary()
            return Expression(f"({token}{operand.code})", operand.type)
        if self._take("!"):
            return Expression(f"(!{self._truth(self._unary())})", PASSIVE)
        if self._take("*"):
            operand = self._unary()
            return Expression(f"(*{operand.code})", operand.type[1])
        if self._take("&"):
            operand = self._unary()
            return Expression(f"(&{operand.code})", ("pointer", operand.type))
        if token in ("++", "--"):
            self._next()
            operand = self._unary()
            if operand.type == DUAL:
                return Expression(f"(*dual_increment(&{operand.code}))", DUAL)
            return Expression(f"({token}{operand.code})", operand.type)
        if self._take("sizeof"):
            if self._peek() == "(" and self._starts_type(1):
                return Expression(f"sizeof({self._type_name()[0]})", PASSIVE)
            return Expression(f"sizeof {self._unary().code}", PASSIVE)
        if token == "(" and self._starts_type(1):
            code, kind = self._type_name()
            if self._peek() == "{":
                initial = self._initial(kind)
                return Expression(initial if kind == ROW else f"(({code}){initial})", kind)
            operand = self._unary()
            if kind == DUAL:  # a plain number that is cast to double stays plain
                return operand if operand.type == DUAL else Expression(f"((double){operand.code})", PASSIVE)
            return Expression(f"(({code}){self._as(operand, kind)})", kind)
        return self._postfix()

    def _type_name(self) -> tuple[str, Type]:
        """Read a type in parentheses."""
        self._expect("(")
        base = self._base_type()
        stars, _, kind = self._declarator(base.type)
        self._expect(")")
        return f"{base.code} {stars}", kind

    def _postfix(self) -> Expression:
        expression = self._primary()
        while True:
            if self._take("["):
                index = self._expression()
                self._expect("]")
                if expression.type == ROW:
                    expression = Expression(f"{expression.code}.at[{index.code}]", DUAL)
                else:
                    kind = expression.type[1] if isinstance(expression.type, tuple) else PASSIVE
                    expression = Expression(f"{expression.code}[{self._as(index, PASSIVE)}]", kind)
            elif self._peek() in (".", "->"):
                mark, field = self._next(), self._next()
                kind = expression.type if mark == "." else expression.type[1]
                expression = Expression(f"{expression.code}{mark}{field}", self.structs[kind[1]][field])
            elif self._peek() in ("++", "--"):
                expression = Expression(f"{expression.code}{self._next()}", expression.type)
            elif self._peek() == "(":
                expression = self._call(expression, self.callable_types[expression.type[1]])
            else:
                return expression

    def _primary(self) -> Expression:
        token = self._next()
        if token == "(":
            inner = self._expression()
            self._expect(")")
            return Expression(f"({inner.code})", inner.type)
        if re.match(r"[\d.\"]", token):
            return Expression(token, PASSIVE)
        if self._peek() == "(":
            return self._named_call(token)
        for scope in reversed(self.scopes):
            if token in scope:
                return Expression(token, scope[token])
        return Expression(token, PASSIVE)  # an entry of an enum, or NAN and INFINITY

    def _arguments(self) -> list[Expression]:
        self._expect("(")
        arguments = []
        while not self._take(")"):
            arguments.append(self._assignment())
            self._take(",")
        return arguments

    def _call(self, target: Expression, function: Function) -> Expression:
        arguments = zip(self._arguments(), function.parameters, strict=True)
        return Expression(
            f"{target.code}({', '.join(self._as(value, kind) for value, kind in arguments)})", function.result
        )

    def _named_call(self, name: str) -> Expression:
        """Translate a call by the function's name: of the source itself, of the C library, or built into the
        compiler.
        """
        if name in self.functions:
            return self._call(Expression(name, None), self.functions[name])
        if name == "offsetof":
            return Expression(f"offsetof{self._skip_group()}", PASSIVE)
        if name == "__builtin_convertvector":
            self._expect("(")
            value = self._assignment()
            self._expect(",")
            to_row = self._next() == "Row"
            self._expect(")")
            if to_row:
                return Expression(f"row_from_cells({value.code})", ROW)
            return Expression(f"row_to_cells({value.code})", PASSIVE)
        # CasADi compares values; the hand-written code looks for a case in which a short cut is exact (dual.h).
        self.compares_values = name == "v_truth"
        arguments = self._arguments()
        self.compares_values = False
        if name == "ALL":  # a number in all lanes
            return arguments[0]
        if name in ("v_truth", "v_not", "v_and", "v_or", "v_sign", "v_if"):
            return self._logic(name, arguments)
        name = name.removeprefix("v_")
        if name in ELEMENTARY and any(argument.type == DUAL for argument in arguments):
            return Expression(f"dual_{name}({', '.join(self._as(argument, DUAL) for argument in arguments)})", DUAL)
        if name not in ELEMENTARY | {"memcpy", "memset", "isfinite"}:
            raise TranslationError(f"unknown function: {name}")
        plain = isinstance(arguments[0].type, tuple)
        codes = [argument.code if plain else self._as(argument, PASSIVE) for argument in arguments]
        return Expression(f"{name}({', '.join(codes)})", PASSIVE)

    def _logic(self, name: str, arguments: list[Expression]) -> Expression:
        """Translate a function of CasADi's logic (lanes.h)."""
        values = [self._as(argument, PASSIVE) for argument in arguments]
        if name == "v_if":
            return Expression(f"dual_if({', '.join(self._as(argument, DUAL) for argument in arguments)})", DUAL)
        if name == "v_sign":
            return Expression(f"dual_sign({self._as(arguments[0], DUAL)})", PASSIVE)
        code = {"v_truth": "{0}", "v_not": "{0} == 0.0", "v_and": "{0} != 0.0 && {1} != 0.0",
                "v_or": "{0} != 0.0 || {1} != 0.0"}[name].format(*values)  # fmt: skip
        return Expression(f"dual_truth({code})", PASSIVE)
