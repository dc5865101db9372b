"""A capture comes back from the journal with the same bits, whatever it holds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from impactcell.errors import JournalError
from impactcell.journal.blobs import decode_capture, encode_capture
from impactcell.records import Capture, Channel, Summary, uniform_times

floats = st.floats(allow_nan=True, allow_infinity=True)


@st.composite
def channels(draw: st.DrawFn) -> Channel:
    count = draw(st.integers(0, 40))
    if draw(st.booleans()):
        time_s = uniform_times(
            draw(st.floats(-1, 1)), draw(st.sampled_from([148.0, 1e4, 1e6, 12345.678])), count
        )
    else:
        time_s = np.sort(draw(hnp.arrays(np.float64, count, elements=st.floats(-1e3, 1e3))))
    resolution = draw(st.sampled_from([None, 5e-7, 0.02, 1.0]))
    if resolution and draw(st.booleans()):
        values = draw(hnp.arrays(np.int64, count, elements=st.integers(-(2**40), 2**40))) * resolution
    else:
        values = draw(hnp.arrays(np.float64, count, elements=floats))
    return Channel(
        time_s, values, draw(st.none() | st.floats(0, 1)), draw(st.none() | st.just((-5.0, 5.0))), resolution
    )


@given(
    st.none() | channels(),
    st.none() | channels(),
    st.none() | st.text(max_size=20),
    st.dictionaries(st.text(max_size=5), st.floats(allow_nan=False) | st.text(max_size=5), max_size=3),
    st.none() | st.just(Summary(1.5, float("inf"))),
)
def test_same_bits_come_back(
    force: Channel | None,
    position: Channel | None,
    batch_id: str | None,
    covariates: dict[str, float | str],
    summary: Summary | None,
) -> None:
    capture = Capture(
        7,
        0.05,
        float("nan"),
        force,
        position,
        batch_id=batch_id,
        covariates=covariates,
        session=2**40,
        summary=summary,
    )
    back = decode_capture(encode_capture(capture))
    for name in ("force", "position"):
        was, now = getattr(capture, name), getattr(back, name)
        assert (was is None) == (now is None)
        if was is not None:
            assert now.values.tobytes() == was.values.tobytes()
            assert now.time_s.tobytes() == was.time_s.tobytes()
            assert (now.noise_std, now.full_scale, now.resolution) == (
                was.noise_std,
                was.full_scale,
                was.resolution,
            )
    assert (back.batch_id, dict(back.covariates), back.session, back.summary) == (
        batch_id,
        covariates,
        2**40,
        summary,
    )
    assert np.isnan(back.mass_kg)


def test_integer_codes_are_kept_small() -> None:
    rng = np.random.default_rng(0)
    codes = np.rint(rng.normal(0, 20, 20_000) + 5000 * np.sin(np.linspace(0, 3, 20_000)))
    coded = Capture(
        1, 0.05, 18.9, Channel(uniform_times(0.0, 1e6, 20_000), codes * 0.02, resolution=0.02), None
    )
    assert len(encode_capture(coded)) < 2 * 20_000


@given(st.binary(max_size=200), st.booleans())
def test_foreign_bytes_are_refused(noise: bytes, prefixed: bool) -> None:
    with pytest.raises(JournalError):
        decode_capture((b"ICC2" if prefixed else b"") + noise)
