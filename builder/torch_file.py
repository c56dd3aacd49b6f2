"""Arrays out of a `.pth` file without torch, by an unpickler that knows three names only."""

import io
import pickle
import zipfile
from collections import OrderedDict
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.errors import BadFile, cut
from workbench.reading.arrays import DAMAGE

DAMAGED: tuple[type[Exception], ...] = (*DAMAGE, pickle.UnpicklingError)


def _tensor(storage: NDArray[np.float32], offset: int, shape: tuple[int, ...], *_: object) -> Array:
    """A contiguous tensor: `shape` numbers of its storage, from `offset` on."""
    return storage[offset : offset + int(np.prod(shape))].reshape(shape).astype(np.float64)


class _TensorUnpickler(pickle.Unpickler):
    """Reads a dictionary of float32 tensors; refuses every other name."""

    KNOWN: ClassVar[dict[tuple[str, str], Any]] = {
        ("torch._utils", "_rebuild_tensor_v2"): _tensor,
        ("torch", "FloatStorage"): np.dtype("<f4"),
        ("collections", "OrderedDict"): OrderedDict,
    }

    def __init__(self, archive: zipfile.ZipFile, root: str) -> None:
        super().__init__(io.BytesIO(archive.read(f"{root}data.pkl")))
        self.archive, self.root = archive, root

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in self.KNOWN:
            raise BadFile(f"the file asks for {module}.{name}, which is not needed for tensors")
        return self.KNOWN[module, name]

    def persistent_load(self, pid: Any) -> NDArray[np.float32]:
        _, dtype, key, _, _ = pid
        return np.frombuffer(self.archive.read(f"{self.root}data/{key}"), dtype)


def read_tensors(content: bytes) -> dict[str, Array]:
    """The named float32 tensors of a `.pth` file. Raises `BadFile` for anything else in it.

    What is given here comes from a wheel whose hash is known, so that nothing bounds the work: this
    is no reader for files of anybody's.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            (pickled,) = (name for name in archive.namelist() if name.endswith("/data.pkl"))
            found = _TensorUnpickler(archive, pickled.removesuffix("data.pkl")).load()
    except DAMAGED as error:
        raise BadFile(f"the file of tensors is damaged: {cut(error)}") from error
    if not isinstance(found, dict):
        raise BadFile(f"the file of tensors holds a {type(found).__name__}, not a dictionary")
    return dict(found)
