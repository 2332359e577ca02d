"""Makes the labelled data and trains the detector: python models/train.py (numpy and onnx; the same result each time).

A person in an image has a height and a contrast; other things are low. In the dark both are measured with more noise.
"""

import csv
from pathlib import Path

import numpy as np
import onnx

HERE = Path(__file__).parent
draw = np.random.default_rng(7)


def scene(person: bool, light: str) -> tuple[float, float]:
    height = draw.uniform(0.6, 1.9) if person else draw.uniform(0.05, 0.4)
    contrast = draw.uniform(0.3, 1.0) if light == "day" else draw.uniform(0.05, 0.6)
    noise = 0.02 if light == "day" else 0.04
    return max(height + draw.normal(0, noise), 0.0), min(max(contrast + draw.normal(0, noise), 0.0), 1.0)


def table(number: int) -> list[tuple[float, float, str, str]]:
    rows = []
    for k in range(number):
        person, light = bool(k % 5), "day" if k % 2 else "night"
        height, contrast = scene(person, light)
        rows.append((round(height, 3), round(contrast, 3), "yes" if person else "no", light))
    return rows


def trained(rows: list[tuple[float, float, str, str]]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Two inputs, four neurons, one output, by gradient descent on the logistic loss."""
    x = np.array([row[:2] for row in rows])
    y = np.array([row[2] == "yes" for row in rows], float)
    w1, b1, w2, b2 = draw.normal(0, 1, (2, 4)), np.zeros(4), draw.normal(0, 1, 4), 0.0
    for _ in range(4000):
        hidden = np.maximum(x @ w1 + b1, 0)
        error = 1 / (1 + np.exp(-(hidden @ w2 + b2))) - y
        back = np.outer(error, w2) * (hidden > 0)
        w2 -= 0.5 * hidden.T @ error / len(y)
        b2 -= 0.5 * error.mean()
        w1 -= 0.5 * x.T @ back / len(y)
        b1 -= 0.5 * back.mean(axis=0)
    return w1, b1, w2.reshape(4, 1), np.array([b2])


def saved(weights: tuple[np.ndarray, ...], path: Path) -> None:
    names = ("w1", "b1", "w2", "b2")
    constants = [onnx.numpy_helper.from_array(w.astype(np.float32), n) for w, n in zip(weights, names, strict=True)]
    nodes = [
        onnx.helper.make_node("Gemm", ["x", "w1", "b1"], ["sum"]),
        onnx.helper.make_node("Relu", ["sum"], ["hidden"]),
        onnx.helper.make_node("Gemm", ["hidden", "w2", "b2"], ["score"]),
    ]
    ends = [onnx.helper.make_tensor_value_info(n, onnx.TensorProto.FLOAT, [1, k]) for n, k in (("x", 2), ("score", 1))]
    graph = onnx.helper.make_graph(nodes, "detector", ends[:1], ends[1:], constants)
    opset = [onnx.helper.make_opsetid("", 13)]
    onnx.save(onnx.helper.make_model(graph, ir_version=8, opset_imports=opset), str(path))


if __name__ == "__main__":
    saved(trained(table(2000)), HERE / "detector.onnx")
    with (HERE.parent / "data/labelled.csv").open("w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(("run", "height", "contrast", "person", "light"))
        out.writerows((k, *row) for k, row in enumerate(table(2000), 1))
