"""Networks for the tests, made with `onnx.helper`."""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence
from typing import Any

import pytest

onnx = pytest.importorskip("onnx", reason="onnx is not here: pip install 'avow[perception]'")
pytest.importorskip("onnxruntime", reason="onnxruntime is not here: pip install 'avow[perception]'")
pytest.importorskip("maraboupy", reason="maraboupy is not here: pip install 'avow[perception]'")

Layer = tuple[Sequence[Sequence[float]], Sequence[float]]
"""For each neuron its weights, and its bias."""


def network(*layers: Layer) -> bytes:
    """Weighted sums, with Relu between them."""
    nodes, constants, at = [], [], "in"
    for k, (weights, biases) in enumerate(layers):
        columns = [list(column) for column in zip(*weights, strict=True)]
        constants += [_constant(f"w{k}", columns), _constant(f"b{k}", biases)]
        nodes.append(onnx.helper.make_node("Gemm", [at, f"w{k}", f"b{k}"], [f"sum{k}"]))
        at = f"sum{k}"
        if k < len(layers) - 1:
            nodes.append(onnx.helper.make_node("Relu", [at], [f"relu{k}"]))
            at = f"relu{k}"
    return graph(nodes, constants, [1, len(layers[0][0][0])], at)


def graph(nodes: list[Any], constants: list[Any], shape: list[Any], output: str) -> bytes:
    """A model whose input is `in`."""
    of = onnx.TensorProto.FLOAT
    given = [onnx.helper.make_tensor_value_info("in", of, shape)]
    made = [onnx.helper.make_tensor_value_info(output, of, None)]
    whole = onnx.helper.make_graph(nodes, "net", given, made, constants)
    opset = [onnx.helper.make_opsetid("", 13)]
    found: bytes = onnx.helper.make_model(whole, opset_imports=opset, ir_version=8).SerializeToString()
    return found


def _constant(name: str, values: Any) -> Any:
    import numpy as np

    return onnx.numpy_helper.from_array(np.array(values, dtype=np.float32), name)


def drawn(draw: random.Random, *sizes: int) -> bytes:
    """A random network with layers of these sizes, the input first."""
    return network(
        *(
            ([[draw.gauss(0, 1) for _ in range(n)] for _ in range(m)], [draw.gauss(0, 0.5) for _ in range(m)])
            for n, m in itertools.pairwise(sizes)
        )
    )


def warner(limit: float) -> bytes:
    """relu(r - limit), so that the output exceeds 0 where r exceeds the limit."""
    return network(([[1.0]], [-limit]), ([[1.0]], [0.0]))
