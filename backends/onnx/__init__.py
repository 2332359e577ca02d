"""Neural networks as ONNX files (see `docs/backends/onnx.md`).

`reading` reads the file, `options` connects ports to the network's inputs and outputs, `cases` splits the denied
guarantee into conjunctions of linear constraints. `intervals` and `marabou` refute such a conjunction, `running` runs
the network in onnxruntime, and `settle` derives the verdict.
"""

from .backend import OnnxBackend

BACKEND = OnnxBackend()
