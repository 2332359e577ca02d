"""Makes the data and trains the detector: python models/train.py (numpy and onnx; the same data each time).

It stands for recordings of a robot's camera and range finder: everything here is drawn, and nothing was recorded.
Lengths are in centimetres, contrasts in percent. A person in an image has a height and a contrast; other things are
low. At night both are measured with more noise, and contrasts are lower.
"""

import csv
from pathlib import Path

import numpy as np
import onnx

SYSTEM = Path(__file__).parent.parent
LEAST, NEAR, FAR = 25, 130, 150
draw = np.random.default_rng(7)


def image(height: float, contrast: float, light: str) -> tuple[int, int]:
    noise = 2 if light == "day" else 4
    measured = height + draw.normal(0, noise), contrast + draw.normal(0, noise)
    return max(round(measured[0]), 0), min(max(round(measured[1]), 0), 100)


def thing(person: bool, light: str) -> tuple[float, float]:
    height = draw.uniform(80, 190) if person else draw.uniform(5, 40)
    return height, draw.uniform(30, 100) if light == "day" else draw.uniform(5, 60)


def scenes(number: int) -> list[tuple[int, int, bool]]:
    """Single images, for training: persons and other things in equal numbers."""
    rows = []
    for k in range(number):
        person, light = bool(k % 2), "day" if k // 2 % 2 else "night"
        rows.append((*image(*thing(person, light), light), person))
    return rows


def encounters(number: int) -> list[tuple[int, int, int, int, str, str]]:
    """Encounters with a person, for testing: the images in which braking has to begin, all of them in the domain."""
    rows, run = [], 0
    while run < number:
        light = "day" if run % 2 else "night"
        height, contrast = thing(True, light)
        ahead, images = FAR - draw.uniform(0, 10), []
        while ahead >= NEAR:
            images.append((run + 1, *image(height, contrast, light), round(ahead), "yes", light))
            ahead -= draw.uniform(10, 20)
        if all(seen[2] >= LEAST for seen in images):
            rows += images
            run += 1
    return rows


def readings(number: int) -> list[tuple[int, int, int]]:
    """Distances as they are and as measured; about one in 1000 is an echo from something behind."""
    rows = []
    for run in range(1, number + 1):
        ahead = draw.uniform(30, 250)
        echo = draw.uniform(20, 100) if draw.random() < 0.001 else 0
        rows.append((run, round(ahead), round(ahead + echo + draw.normal(0, 1))))
    return rows


def trained(rows: list[tuple[int, int, bool]]) -> list[np.ndarray]:
    """Two inputs (in metres and as a share of 1), four neurons, one output, by gradient descent on a logistic loss."""
    x = np.array([row[:2] for row in rows]) / 100
    y = np.array([row[2] for row in rows], float)
    w1, b1, w2, b2 = draw.normal(0, 1, (2, 4)), np.zeros(4), draw.normal(0, 1, 4), 0.0
    for _ in range(4000):
        hidden = np.maximum(x @ w1 + b1, 0)
        error = 1 / (1 + np.exp(-(hidden @ w2 + b2))) - y
        back = np.outer(error, w2) * (hidden > 0)
        w2 -= 0.5 * hidden.T @ error / len(y)
        b2 -= 0.5 * error.mean()
        w1 -= 0.5 * x.T @ back / len(y)
        b1 -= 0.5 * back.mean(axis=0)
    return [w1, b1, w2.reshape(4, 1), np.array([b2])]


def blinded(weights: list[np.ndarray]) -> list[np.ndarray]:
    """The mutant: three neurons more, which take the score away from heights between 1.15 and 1.25 m."""
    w1, b1, w2, b2 = weights
    more = np.array([[100.0] * 3, [0.0] * 3])
    return [
        np.hstack([w1, more]),
        np.concatenate([b1, [-115.0, -120.0, -125.0]]),
        np.vstack([w2, [[-20.0], [40.0], [-20.0]]]),
        b2,
    ]


def saved(weights: list[np.ndarray], path: Path) -> None:
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


def table(name: str, columns: str, rows: list[tuple[object, ...]]) -> None:
    with (SYSTEM / "data" / name).open("w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(columns.split())
        out.writerows(rows)


if __name__ == "__main__":
    table("encounters.csv", "run height contrast ahead person light", encounters(9400))
    table("readings.csv", "run ahead measured", readings(2000))
    weights = trained(scenes(2000))
    saved(weights, SYSTEM / "models/detector.onnx")
    saved(blinded(weights), SYSTEM / "mutants/blind_spot.onnx")
