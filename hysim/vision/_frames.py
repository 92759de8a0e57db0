"""Frames, one at a time, as grey pictures of one size.

Colours become luminance, 0.2125 red + 0.7154 green + 0.0721 blue (ITU-R BT.709); an opacity is left out.
"""

import logging
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import frozen
from hysim._basics.libraries import optional

Picture = npt.NDArray[np.float32]

_LUMINANCE = np.array([0.2125, 0.7154, 0.0721], dtype=np.float32)
_READERS = {".png": "pillow", ".tif": "tifffile", ".tiff": "tifffile", ".avi": "pyav", ".mp4": "pyav"}
_STILL = (".png", ".tif", ".tiff")
_GREY_VIDEO = re.compile(r"gray(9|10|12|14|16)?(le|be)?")


@frozen
class FrameSource:
    """Frames in files, read one after the other each time they are iterated over.

    Parameters
    ----------
    path : Path
        The file, or the folder.
    files : tuple of Path
        The files, in the order of the frames.
    n_frames : int or None
        How many frames they say that they hold; None where a video does not say.
    """

    path: Path
    files: tuple[Path, ...]
    n_frames: int | None

    def __iter__(self) -> Iterator[Picture]:
        expected = 1 if self.path.is_dir() else self.n_frames
        return grey_pictures((frame for file in self.files for frame in _frames_of(file, expected)), self._name)

    def __length_hint__(self) -> int:
        return NotImplemented if self.n_frames is None else self.n_frames

    def _name(self, k: int) -> str:
        return str(self.files[k]) if self.path.is_dir() else f"{self.path}: frame {k}"


def read_frames(path: str | Path) -> FrameSource:
    """The frames of a folder of pictures, of a TIFF file of many pages, or of a video.

    Nothing but the number of frames is read before they are asked for, and never more than one of them is kept.

    Parameters
    ----------
    path : str or path
        A folder of PNG or TIFF files, in the natural order of their names (9 before 10); a TIFF or PNG file; an AVI
        or MP4 file.

    Returns
    -------
    FrameSource
        To iterate over: arrays of shape (height, width) [intensity as stored].

    Raises
    ------
    FileNotFoundError
        If there is no such file or folder.
    ValueError
        If there are no frames, a file is no picture or video, or is truncated, or, while iterating, a frame has
        another size than the first one. The message is one line that names the file and the frame.
    ImportError
        If imageio is not installed.

    Examples
    --------
    >>> import hysim as hs
    >>> try:
    ...     hs.vision.read_frames("stairs.avi")
    ... except FileNotFoundError as error:
    ...     print(error)
    stairs.avi: there is no such file or folder
    """
    source = Path(path)
    if not source.exists():
        raise FileNotFoundError(f"{source}: there is no such file or folder")
    if source.suffix.lower() not in _READERS and not source.is_dir():
        raise ValueError(
            f"{source}: frames are read from a folder of PNG or TIFF files, or from a PNG, TIFF, AVI or MP4 file"
        )
    if not source.is_dir():
        return FrameSource(path=source, files=(source,), n_frames=_count(source))
    files = sorted((file for file in source.iterdir() if file.suffix.lower() in _STILL), key=_natural)
    if not files:
        raise ValueError(f"{source}: there are no PNG or TIFF files in this folder")
    return FrameSource(path=source, files=tuple(files), n_frames=len(files))


def grey_pictures(frames: Iterable[Any], name: Callable[[int], str]) -> Iterator[Picture]:
    """The frames as grey pictures, checked to be of one size; `name(k)` is what the k-th one is called."""
    shape = None
    for k, frame in enumerate(frames):
        picture = _grey(np.asarray(frame), name(k))
        shape = shape or picture.shape
        if picture.shape != shape:
            raise ValueError(
                f"{name(k)} is {_size(picture.shape)} pixels where the first one is {_size(shape)}: all frames must "
                "have one size"
            )
        yield picture


def _grey(frame: npt.NDArray[Any], name: str) -> Picture:
    if frame.dtype.kind not in "buif":
        raise TypeError(f"{name} must hold real numbers, got {frame.dtype}")
    if frame.ndim == 3 and frame.shape[2] in (3, 4):
        frame = frame[:, :, :3].astype(np.float32) @ _LUMINANCE
    elif frame.ndim == 3 and frame.shape[2] in (1, 2):
        frame = frame[:, :, 0]
    if frame.ndim != 2:
        raise ValueError(f"{name} must have the shape (height, width) or (height, width, 3 or 4), got {frame.shape}")
    picture = frame.astype(np.float32)
    if not np.isfinite(picture.sum()):
        raise ValueError(f"{name} must be finite: it holds nan or infinity")
    largest = np.abs(picture).max(initial=0.0)
    return picture if largest == 0.0 or 1e-12 < largest < 1e12 else picture / largest  # squares must not overflow


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[0]} x {shape[1]}"


def _natural(path: Path) -> list[tuple[int, int | str]]:
    """Numbers in a name by their value, and before letters."""
    return [(0, int(part)) if part.isdigit() else (1, part) for part in re.split(r"(\d+)", path.name.lower()) if part]


def _count(file: Path) -> int | None:
    """Number of frames in a file, None if unknown; an error if the content does not suit the ending of the name."""
    library, reader = optional("imageio.v3", "reading frames", "vision"), _READERS[file.suffix.lower()]
    if reader == "pillow":
        return 1
    with _reading(file), library.imopen(file, "r", plugin=reader) as opened:
        pages = {"page": ...} if reader == "tifffile" else {}
        return opened.properties(index=..., **pages).n_images or None


def _frames_of(file: Path, expected: int | None) -> Iterator[npt.NDArray[Any]]:
    library, reader = optional("imageio.v3", "reading frames", "vision"), _READERS[file.suffix.lower()]
    k = 0
    with _reading(file), library.imopen(file, "r", plugin=reader) as opened:
        for frame in _opened(opened, reader):
            k += 1
            yield frame
    if expected == 1 and k > 1:
        raise ValueError(f"{file}: there are {k} frames in this file: in a folder each file is one frame")
    if expected is not None and k < expected:
        raise ValueError(f"{file}: the file is truncated: it ends after {k} of {expected} frames")


def _opened(opened: Any, reader: str) -> Iterable[npt.NDArray[Any]]:
    if reader == "pillow":
        frames: Iterable[npt.NDArray[Any]] = [opened.read(index=0)]
    elif reader == "tifffile":
        frames = opened.iter_pages()
    else:
        is_grey = _GREY_VIDEO.fullmatch(opened.metadata().get("video_format", ""))
        frames = opened.iter(format=None if is_grey else "rgb24")
    return frames


class _Complaints(logging.Handler):
    """Keeps what a log is told."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self.told: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.told.append(record.getMessage())


@contextmanager
def _reading(file: Path) -> Iterator[None]:
    """Turn errors of the libraries, and messages in tifffile's log, into one error that names the file."""
    log, complaints = logging.getLogger("tifffile"), _Complaints(logging.ERROR)
    log.addHandler(complaints)
    try:
        yield
    except Exception as error:  # each library raises other kinds of errors
        raise ValueError(f"{file}: not a readable {file.suffix} file: {_line(error)}") from None
    finally:
        log.removeHandler(complaints)
    if complaints.told:
        raise ValueError(f"{file}: the file is damaged or truncated: {complaints.told[0]}")


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
