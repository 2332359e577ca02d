"""Reads an ONNX file as a list of neurons, without any library: each is an input, a weighted sum of earlier ones, or
the greater of zero and an earlier one.

The file's format is Protocol Buffers with the field numbers of `onnx.proto` (ONNX IR, version 3 and later). The
meaning of an operator is that of the ONNX operator schemas. `running` compares the neurons with onnxruntime, so that a
fault here is noticed.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from avow.backend_kit.given import file_bytes
from avow.base.diagnostics import Diagnostic, Rejected, Span

from .tuning import NETWORK_BYTES, WEIGHTS

OPERATORS = ("Gemm", "MatMul", "Add", "Relu", "Conv", "Flatten", "Reshape", "Identity", "Constant")
_FLOAT, _INT64 = 1, 7  # TensorProto.DataType


@dataclass(frozen=True, slots=True)
class Sum:
    """The sum of `weights[k]` times the neuron `of[k]`, and `bias`."""

    of: tuple[int, ...]
    weights: tuple[float, ...]
    bias: float


@dataclass(frozen=True, slots=True)
class Relu:
    """The greater of zero and the neuron `of`."""

    of: int


Neuron = Sum | Relu


@dataclass(frozen=True, slots=True)
class Network:
    """The neurons 0 to `inputs` - 1 are the inputs, in the order of the input tensor's elements; `neurons` follow."""

    inputs: int
    shape: tuple[int, ...]
    """Of the input tensor; a free dimension is 1."""
    neurons: tuple[Neuron, ...]
    outputs: tuple[int, ...]


class Unfit(Exception):  # noqa: N818 - it names what the file is
    """Code, and what is wrong."""


@dataclass(frozen=True, slots=True)
class _Tensor:
    """Constants, or neurons by number if `live`."""

    shape: tuple[int, ...]
    items: Sequence[float | int]
    live: bool = False

    def __post_init__(self) -> None:
        if math.prod(self.shape) != len(self.items) or min(self.shape, default=1) < 1:
            raise Unfit("ONNX113", f"{len(self.items)} values in a tensor of shape {list(self.shape)}")


def read_network(path: Path) -> Network:
    """Raises Rejected."""
    data = file_bytes(path, "ONNX102", "ONNX113", NETWORK_BYTES)
    try:
        return _Reader().network(data)
    except Unfit as error:
        code, message = error.args
    except (IndexError, struct.error, UnicodeDecodeError, OverflowError, ValueError, RecursionError):
        code, message = "ONNX111", "the file is no ONNX model"
    raise Rejected(Diagnostic(code, message, Span(str(path), 1, 1, 1, 2)))


# -- the format --------------------------------------------------------------------------------------------------------

_Fields = Mapping[int, list[int | bytes]]


def _fields(data: bytes) -> _Fields:
    """The fields of a message: numbers, or bytes."""
    found: dict[int, list[int | bytes]] = {}
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        value: int | bytes
        match key & 7:
            case 0:
                value, at = _varint(data, at)
            case 1 | 5 as wire:
                size = 8 if wire == 1 else 4
                value, at = data[at : at + size], at + size
            case 2:
                size, at = _varint(data, at)
                value, at = data[at : at + size], at + size
            case _:
                raise ValueError("no such wire type")
        if at > len(data):
            raise ValueError("the file ends too early")
        found.setdefault(key >> 3, []).append(value)
    return found


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        value, shift, at = value | (byte & 127) << shift, shift + 7, at + 1
        if not byte & 128:
            return value, at
        if shift > 63:
            raise ValueError("the number is too long")


def _messages(fields: _Fields, number: int) -> Iterator[_Fields]:
    for value in fields.get(number, ()):
        if isinstance(value, int):
            raise ValueError("a number in place of a message")
        yield _fields(value)


def _texts(fields: _Fields, number: int) -> tuple[str, ...]:
    return tuple(value.decode() for value in fields.get(number, ()) if isinstance(value, bytes))


def _text(fields: _Fields, number: int) -> str:
    return (*_texts(fields, number), "")[0]


def _integers(fields: _Fields, number: int) -> tuple[int, ...]:
    """Signed numbers, packed or not."""
    found = []
    for value in fields.get(number, ()):
        at = 0
        while isinstance(value, bytes) and at < len(value):
            one, at = _varint(value, at)
            found.append(one)
        found += [value] if isinstance(value, int) else []
    return tuple(one - (1 << 64) if one >> 63 else one for one in found)


def _floats(fields: _Fields, number: int) -> tuple[float, ...]:
    data = b"".join(value for value in fields.get(number, ()) if isinstance(value, bytes))
    return struct.unpack(f"<{len(data) // 4}f", data)


def _tensor(fields: _Fields) -> _Tensor:
    (kind,) = _integers(fields, 2) or (0,)
    if kind not in (_FLOAT, _INT64) or fields.get(13) or any(_integers(fields, 14)):
        raise Unfit("ONNX113", f"the tensor '{_text(fields, 8)}' is not stored as float32 or int64 in the file")
    raw = b"".join(value for value in fields.get(9, ()) if isinstance(value, bytes))
    items: Sequence[float | int]
    if kind == _FLOAT:
        items = struct.unpack(f"<{len(raw) // 4}f", raw) if raw else _floats(fields, 4)
    else:
        items = struct.unpack(f"<{len(raw) // 8}q", raw) if raw else _integers(fields, 7)
    if not all(map(math.isfinite, items)):
        raise Unfit("ONNX113", f"the tensor '{_text(fields, 8)}' has a value that is not finite")
    return _Tensor(_integers(fields, 1), items)


def _shape(value: _Fields) -> tuple[int, ...]:
    """Of a graph's input or output."""
    (kind,) = _messages(value, 2)
    (tensor,) = _messages(kind, 1)
    if _integers(tensor, 1) != (_FLOAT,):
        raise Unfit("ONNX111", f"'{_text(value, 1)}' is no tensor of float32")
    dims = [_integers(dim, 1) for shape in _messages(tensor, 2) for dim in _messages(shape, 1)]
    return tuple(dim[0] if dim else 1 for dim in dims)


# -- the operators -----------------------------------------------------------------------------------------------------


class _Attributes:
    def __init__(self, node: _Fields) -> None:
        self._known = {_text(each, 1): each for each in _messages(node, 5)}

    def real(self, name: str, default: float) -> float:
        found = _floats(self._known[name], 2) if name in self._known else ()
        return found[0] if found else default

    def numbers(self, name: str, default: tuple[int, ...]) -> tuple[int, ...]:
        given = self._known.get(name)
        return default if given is None else (_integers(given, 8) or _integers(given, 3))

    def number(self, name: str, default: int) -> int:
        return self.numbers(name, (default,))[0]

    def word(self, name: str) -> str:
        return _text(self._known[name], 4) if name in self._known else ""

    def tensor(self, name: str) -> _Tensor:
        if name not in self._known:
            raise Unfit("ONNX113", f"a constant without '{name}'")
        (found,) = _messages(self._known[name], 5)
        return _tensor(found)


class _Reader:
    def __init__(self) -> None:
        self.values: dict[str, _Tensor] = {}
        self.neurons: list[Sum | Relu] = []
        self.inputs = 0
        self.used = 0

    def network(self, data: bytes) -> Network:
        (graph,) = _messages(_fields(data), 7)
        self.values = {_text(_fields_of, 8): _tensor(_fields_of) for _fields_of in _messages(graph, 5)}
        given = [value for value in _messages(graph, 11) if _text(value, 1) not in self.values]
        results = list(_messages(graph, 12))
        if len(given) != 1 or len(results) != 1:
            raise Unfit("ONNX111", f"the network has {len(given)} inputs and {len(results)} outputs, not one of each")
        shape = _shape(given[0])
        self.inputs = math.prod(shape)
        if not 0 < self.inputs <= WEIGHTS:
            raise Unfit("ONNX113", f"an input of shape {list(shape)}")
        self.values[_text(given[0], 1)] = _Tensor(shape, range(self.inputs), True)
        for node in _messages(graph, 1):
            self.apply(node)
        _shape(results[0])
        found = self.values.get(_text(results[0], 1))
        if found is None or not found.live:
            raise Unfit("ONNX111", "the network's output does not depend on its input")
        return Network(self.inputs, shape, tuple(self.neurons), tuple(map(int, found.items)))

    def apply(self, node: _Fields) -> None:
        kind, name = _text(node, 4), _text(node, 3) or (*_texts(node, 2), "?")[0]
        if kind not in OPERATORS or _text(node, 7) not in ("", "ai.onnx"):
            raise Unfit("ONNX112", f"the operator {kind or '?'} of '{name}' is not supported")
        try:
            given = [self.values[one] for one in _texts(node, 1) if one]
            result = self.result(kind, given, _Attributes(node))
        except (ValueError, IndexError, KeyError, ZeroDivisionError):
            raise Unfit("ONNX113", f"{kind} '{name}' has inputs or attributes that are not supported") from None
        for one in _texts(node, 2)[:1]:
            self.values[one] = result

    def result(self, kind: str, given: list[_Tensor], with_: _Attributes) -> _Tensor:
        match kind:
            case "Identity":
                (one,) = given
                return one
            case "Constant":
                return with_.tensor("value")
            case "Relu":
                (one,) = given
                return _Tensor(one.shape, [self.neuron(Relu(int(of))) for of in _live(one).items], True)
            case "Flatten":
                (one,), axis = given, with_.number("axis", 1)
                axis += len(one.shape) if axis < 0 else 0
                return _Tensor((math.prod(one.shape[:axis]), math.prod(one.shape[axis:])), one.items, one.live)
            case "Reshape":
                one, to = given
                return _Tensor(_reshaped(one.shape, to, with_.number("allowzero", 0)), one.items, one.live)
            case "Add":
                return self.added(given[0], given[1])
            case "MatMul":
                return self.multiplied(given[0], given[1])
            case "Gemm":
                a, b, *c = given
                a, b = (_turned(one) if with_.number(t, 0) else one for one, t in ((a, "transA"), (b, "transB")))
                whole = self.multiplied(a, b, with_.real("alpha", 1.0))
                beta = with_.real("beta", 1.0)
                return self.added(whole, _Tensor(c[0].shape, [beta * x for x in _constant(c[0])])) if c else whole
            case _:  # Conv, by OPERATORS
                return self.convolved(given, with_)

    def neuron(self, one: Sum | Relu) -> int:
        self.neurons.append(one)
        self.used += len(one.of) if isinstance(one, Sum) else 1
        if self.used > WEIGHTS:
            raise Unfit("ONNX113", f"the network has more than {WEIGHTS} weights")
        return self.inputs + len(self.neurons) - 1

    def added(self, a: _Tensor, b: _Tensor) -> _Tensor:
        rank = max(len(a.shape), len(b.shape))
        shape = tuple(map(max, _padded(a.shape, rank), _padded(b.shape, rank)))
        one, other = _spread(a, shape), _spread(b, shape)
        if not a.live:
            (a, one), (b, other) = (b, other), (a, one)
        if b.live:
            sums = [Sum((int(x), int(y)), (1.0, 1.0), 0.0) for x, y in zip(one, other, strict=True)]
        else:
            sums = [Sum((int(x),), (1.0,), float(y)) for x, y in zip(one, other, strict=True)]
        _live(a)
        return _Tensor(shape, [self.neuron(each) for each in sums], True)

    def multiplied(self, a: _Tensor, b: _Tensor, alpha: float = 1.0) -> _Tensor:
        """The product of neurons and constants, in either order; of constants, only two dimensions."""
        if not a.live:
            return _turned(self.multiplied(_turned(b), _turned(a), alpha))
        inner, columns = b.shape
        weights = _constant(b)
        if a.shape[-1] != inner:
            raise ValueError("the shapes do not match")
        made = []
        for at in range(0, len(a.items), inner):
            row = tuple(map(int, a.items[at : at + inner]))
            made += [self.neuron(Sum(row, tuple(alpha * w for w in weights[k::columns]), 0.0)) for k in range(columns)]
        return _Tensor((*a.shape[:-1], columns), made, True)

    def convolved(self, given: list[_Tensor], with_: _Attributes) -> _Tensor:
        """In two dimensions, of one image, without groups."""
        image, kernel, *more = given
        (one, channels, height, width), (made, depth, rows, columns) = image.shape, kernel.shape
        up, left, down, right = with_.numbers("pads", (0, 0, 0, 0))
        (step_y, step_x), (far_y, far_x) = with_.numbers("strides", (1, 1)), with_.numbers("dilations", (1, 1))
        plain = with_.number("group", 1) == 1 and with_.word("auto_pad") in ("", "NOTSET")
        if one != 1 or channels != depth or not plain or min(step_y, step_x, far_y, far_x) < 1:
            raise ValueError("a convolution of another kind")
        weights, pixels = _constant(kernel), _live(image).items
        bias = _constant(more[0]) if more else [0.0] * made
        tall = (height + up + down - far_y * (rows - 1) - 1) // step_y + 1
        wide = (width + left + right - far_x * (columns - 1) - 1) // step_x + 1
        neurons = []
        for m, y, x in product(range(made), range(tall), range(wide)):
            of, by = [], []
            for c, i, j in product(range(channels), range(rows), range(columns)):
                at_y, at_x = y * step_y - up + i * far_y, x * step_x - left + j * far_x
                if 0 <= at_y < height and 0 <= at_x < width:
                    of.append(int(pixels[(c * height + at_y) * width + at_x]))
                    by.append(float(weights[((m * depth + c) * rows + i) * columns + j]))
            neurons.append(self.neuron(Sum(tuple(of), tuple(by), float(bias[m]))))
        return _Tensor((1, made, tall, wide), neurons, True)


def _live(tensor: _Tensor) -> _Tensor:
    if not tensor.live:
        raise ValueError("it is constant")
    return tensor


def _constant(tensor: _Tensor) -> Sequence[float]:
    if tensor.live:
        raise ValueError("it depends on the input")
    return tensor.items


def _turned(tensor: _Tensor) -> _Tensor:
    rows, columns = tensor.shape
    items = [tensor.items[i * columns + j] for j in range(columns) for i in range(rows)]
    return _Tensor((columns, rows), items, tensor.live)


def _padded(shape: tuple[int, ...], rank: int) -> tuple[int, ...]:
    return (*((1,) * (rank - len(shape))), *shape)


def _spread(tensor: _Tensor, shape: tuple[int, ...]) -> list[float | int]:
    """The items, repeated along dimensions of size 1 (numpy's broadcasting)."""
    own = _padded(tensor.shape, len(shape))
    if any(a not in (1, b) for a, b in zip(own, shape, strict=True)):
        raise ValueError("the shapes do not match")
    if math.prod(shape) > WEIGHTS:
        raise Unfit("ONNX113", f"the network has more than {WEIGHTS} weights")
    strides = [math.prod(own[k + 1 :]) if size > 1 else 0 for k, size in enumerate(own)]
    places = product(*map(range, shape))
    return [tensor.items[sum(a * b for a, b in zip(place, strides, strict=True))] for place in places]


def _reshaped(shape: tuple[int, ...], to: _Tensor, zero: int) -> tuple[int, ...]:
    wanted = [int(n) for n in _constant(to)]
    wanted = [shape[k] if n == 0 and not zero else n for k, n in enumerate(wanted)]
    if -1 in wanted:
        wanted[wanted.index(-1)] = math.prod(shape) // -math.prod(wanted)
    return tuple(wanted)
