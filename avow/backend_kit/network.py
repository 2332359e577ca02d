"""A neural network in an ONNX file, as onnxruntime runs it: one input and one output in float32."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime

from avow.base.files import read_regular


class Session:
    """A loaded network, on one processor core."""

    def __init__(self, path: Path) -> None:
        """Raises an exception of onnxruntime if it does not accept the file."""
        options: Any = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4
        self._session = onnxruntime.InferenceSession(read_regular(path), options, ["CPUExecutionProvider"])
        self._input = self._session.get_inputs()[0]

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the input; a dimension without a size (a batch) is 1."""
        return tuple(size if isinstance(size, int) else 1 for size in self._input.shape)

    def outputs(self, point: Sequence[float]) -> list[float]:
        """The outputs in order. Raises ValueError if the input has another number of values."""
        tensor = np.array(point, dtype=np.float32).reshape(self.shape)
        found: list[float] = self._session.run(None, {self._input.name: tensor})[0].ravel().tolist()
        return found
