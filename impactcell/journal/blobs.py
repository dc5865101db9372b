"""Captures as bytes and back, to the same bits.

Layout: magic `ICC2`, then zlib of: header length (u32, little-endian), header (JSON), arrays one after
the other. A channel whose values are whole multiples of its `resolution` is kept as differences of the
integer codes, one whose times follow `records.uniform_times` as start and rate; both are checked sample
by sample when written, and what does not fit is kept as 64-bit floats.

Differences d are kept as 2 d, or -2 d - 1 where negative, so that small ones of either sign have zeros in
their upper bytes; of every array all lowest bytes come first, then all the next. What is noise and what is
not then lie apart, and zlib need not search for repetitions: it takes a sixth of the time, and a third of the
room, of the 64-bit floats.
"""

import json
import math
import struct
import zlib
from dataclasses import replace
from typing import Any

import numpy as np

from impactcell.errors import JournalError
from impactcell.journal.codes import folded_differences, is_uniform, unfolded
from impactcell.records import Capture, Channel, Samples, Summary, uniform_times

MAGIC = b"ICC2"
NONE = np.empty(0, dtype=np.int64)
_CHANNELS = ("force", "position", "actuator")


def encode_capture(capture: Capture) -> bytes:
    """Return the capture as compressed bytes; see the module's docstring for the layout."""
    arrays: list[bytes] = []
    header: dict[str, Any] = {
        "cycle": capture.cycle,
        "time_ns": capture.time_ns,
        "velocity_m_s": capture.velocity_m_s,
        "mass_kg": capture.mass_kg,
        "direction": capture.direction,
        "stroke_m": capture.stroke_m,
        "batch_id": capture.batch_id,
        "dwell_s": capture.dwell_s,
        "start_m": capture.start_m,
        "session": capture.session,
        "covariates": dict(capture.covariates),
    }
    if capture.summary is not None:
        header["summary"] = [capture.summary.peak_force_n, capture.summary.sliding_distance_m]
    for name in _CHANNELS:
        channel: Channel | None = getattr(capture, name)
        if channel is not None:
            header[name] = _encode_channel(channel, arrays)
    text = json.dumps(header).encode()
    compress = zlib.compressobj(level=1, strategy=zlib.Z_RLE)
    parts = [compress.compress(part) for part in (struct.pack("<I", len(text)), text, *arrays)]
    return b"".join([MAGIC, *parts, compress.flush()])


def decode_capture(blob: bytes) -> Capture:
    """Return the capture that `encode_capture` was given.

    Raises
    ------
    JournalError
        If the bytes are not such a capture.
    """
    if blob[:4] != MAGIC:
        raise JournalError("not a capture of this journal format")
    try:
        raw = zlib.decompress(blob[4:])
        (length,) = struct.unpack_from("<I", raw)
        header = json.loads(raw[4 : 4 + length])
        cursor = _Cursor(raw, 4 + length)
        channels = {name: _decode_channel(header.pop(name), cursor) for name in _CHANNELS if name in header}
        summary = header.pop("summary", None)
        capture = Capture(
            **header, force=channels.get("force"), position=channels.get("position"),
            actuator=channels.get("actuator"),
        )  # fmt: skip
        return capture if summary is None else replace(capture, summary=Summary(*summary))
    except (zlib.error, ValueError, KeyError, TypeError, struct.error) as error:
        raise JournalError(f"a stored capture is damaged: {error}") from error


class _Cursor:
    """Reads the arrays of a decompressed capture in the order they were written."""

    def __init__(self, raw: bytes, offset: int) -> None:
        self.raw, self.offset = raw, offset

    def take(self, dtype: str, count: int) -> np.ndarray[Any, Any]:
        size = np.dtype(dtype).itemsize
        planes = np.frombuffer(self.raw, np.uint8, count * size, self.offset)
        self.offset += count * size
        return np.ascontiguousarray(planes.reshape(size, count).T).reshape(-1).view(dtype)


def _planes(values: np.ndarray[Any, Any]) -> bytes:
    """All lowest bytes of an array of little-endian numbers, then all the next."""
    return values.view(np.uint8).reshape(-1, values.itemsize).T.tobytes()


def _encode_channel(channel: Channel, arrays: list[bytes]) -> dict[str, Any]:
    count = len(channel.values)
    header: dict[str, Any] = {
        "count": count,
        "noise_std": channel.noise_std,
        "full_scale": channel.full_scale,
        "resolution": channel.resolution,
    }
    rate_hz = _uniform_rate(channel.time_s)
    if rate_hz is None:
        arrays.append(_planes(channel.time_s.astype("<f8")))
    else:
        header["uniform"] = [float(channel.time_s[0]), rate_hz]
    largest, folded = -1, NONE
    if channel.resolution:
        largest, folded = folded_differences(channel.values, channel.resolution)
    if largest < 0:
        arrays.append(_planes(channel.values.astype("<f8")))
    else:
        header["dtype"] = "<u2" if largest < 2**16 else "<u8"
        arrays.append(_planes(folded.astype(header["dtype"])))
    return header


def _decode_channel(header: dict[str, Any], cursor: _Cursor) -> Channel:
    count = header["count"]
    uniform = header.get("uniform")
    time_s = (
        uniform_times(uniform[0], uniform[1], count)
        if uniform
        else cursor.take("<f8", count).astype(np.float64)
    )
    if "dtype" in header:
        values = unfolded(cursor.take(header["dtype"], count).astype(np.int64), header["resolution"])
    else:
        values = cursor.take("<f8", count).astype(np.float64)
    full_scale = header["full_scale"]
    return Channel(
        time_s=time_s,
        values=values,
        noise_std=header["noise_std"],
        full_scale=None if full_scale is None else (full_scale[0], full_scale[1]),
        resolution=header["resolution"],
    )


def _uniform_rate(time_s: Samples) -> float | None:
    if len(time_s) < 2 or not time_s[-1] > time_s[0]:
        return None
    rate_hz = (len(time_s) - 1) / (float(time_s[-1]) - float(time_s[0]))
    if not math.isfinite(rate_hz):
        return None
    for candidate in (rate_hz, float(round(rate_hz))):
        if candidate > 0 and is_uniform(time_s, candidate):
            return candidate
    return None
