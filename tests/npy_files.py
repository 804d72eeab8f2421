"""`.npy` files, honest and otherwise."""

import io

import numpy as np


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def npy_with_header(header, body=b"", version=1):
    """A `.npy` file whose header is that text."""
    padded = header.encode("latin1") + b" " * (-(len(header) + 11) % 64) + b"\n"
    length = len(padded).to_bytes(2 if version == 1 else 4, "little")
    return b"\x93NUMPY" + bytes([version, 0]) + length + padded + body


def npy_that_claims(dtype, shape, body=b"", version=1):
    """A `.npy` file whose header says so."""
    return npy_with_header(f"{{'descr': {dtype!r}, 'fortran_order': False, 'shape': {shape!r}, }}", body, version)


# to the message that each is refused with
HOSTILE = {
    npy(np.array([{}], object)): "contains a pickle",
    npy_that_claims("|O", (3, 3)): "contains a pickle",
    npy_that_claims([("a", "|O")], (3, 3)): "contains a pickle",
    # claims far more than memory holds
    npy_that_claims("|u1", (10**12,)): "claims 1000000000000 bytes",
    npy_that_claims("|u1", (2, 2, 10**12)): "claims 4000000000000 bytes",
    npy_that_claims("|V2000000000", (20, 20)): "claims 800000000000 bytes",
    npy_that_claims("<f8", (4, 6)): "claims 192 bytes of numbers, has 0",
    npy_that_claims("<f8", (4, 6), b"\0" * 191): "claims 192 bytes of numbers, has 191",
    npy_that_claims("<f8", (4, 6), b"\0" * 193): "claims 192 bytes of numbers, has 193",
    npy_that_claims("|u1", (-2, -2), b"\0" * 4): "damaged",
    npy_that_claims("<f8", (1, 1), b"\0" * 8, version=9): "damaged",
    # no header that can be parsed
    b"\x93NUMPY": "damaged",
    b"\x93NUMPY\x01\x00\xff\xff": "damaged",
    npy(np.ones((4, 6)))[:50]: "damaged",
    npy_with_header("{'descr': ("): "damaged",
    npy_with_header("(" * 9000): "damaged",
    npy_with_header("-" * 8000 + "1"): "damaged",
    npy_with_header("{[]: 1}"): "damaged",
    npy_with_header("  x\n y"): "damaged",
    npy_with_header("\0"): "damaged",
    npy_that_claims(",", (3, 3)): "damaged",
    npy_that_claims("zz", (3, 3)): "damaged",
    npy_with_header("$" * 5000): "damaged",
    npy_with_header("x" * 20_000): "damaged",
}
